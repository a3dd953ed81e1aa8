#include "numbering/ink_fields.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "numbering/color_field.hpp"
#include "numbering/lattice_motion.hpp"
#include "numeric/bilinear.hpp"
#include "numeric/median.hpp"

namespace cmp::numbering {

namespace {

constexpr Index CLASSES = 3, SIDES = 3;
constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr double MIN_ODDS = -12.5;  // five standard deviations
constexpr Index NEIGHBOURS[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};  // of a down-cell

// The light of a value between two whole ones.
double light_between(View<const float, 1> light, double value) {
  const auto low = std::min<Index>(std::max<Index>(static_cast<Index>(value), 0), 254);
  const double share = value - static_cast<double>(low);
  return (1.0 - share) * light[low] + share * light[low + 1];
}

// The light at points (N, 2) of the full image; NaN outside the image. A pixel of a reduced scale is a mean.
std::vector<Color> light_at_points(const image::PyramidLevel& view, View<const double, 2> xy) {
  const auto scale = static_cast<double>(view.scale);
  const Index height = view.image.size(0), width = view.image.size(1);
  const auto flat = view.image.flat();
  const double right = static_cast<double>(width) - numeric::BORDER_PX,
               bottom = static_cast<double>(height) - numeric::BORDER_PX;
  constexpr double ONE = 1.0 / (numeric::SUBPIXEL_STEPS * numeric::SUBPIXEL_STEPS);
  std::vector<Color> out(static_cast<std::size_t>(xy.size()), Color{NOWHERE, NOWHERE, NOWHERE});
  for (Index i = 0; i < xy.size(); ++i) {
    const double x = (xy(i, 0) + 0.5) / scale - 0.5, y = (xy(i, 1) + 0.5) / scale - 0.5;
    if (!(x >= 0.0 && y >= 0.0 && x <= right && y <= bottom)) continue;
    const auto sums = numeric::channel_sums_at(flat, width, x, y);
    out[i] = {light_between(view.response.light, ONE * static_cast<double>(sums.s0)),
              light_between(view.response.light, ONE * static_cast<double>(sums.s1)),
              light_between(view.response.light, ONE * static_cast<double>(sums.s2))};
  }
  return out;
}

// The median of each channel over the known colors, which lose their order; NaN without any.
//
// A few colors are sorted by minima and maxima: a comparison that is often guessed wrong takes longer.
Color median_color(std::vector<Color>& colors) {
  constexpr std::size_t FEW = 6;
  std::erase_if(colors, [](const Color& one) { return !std::isfinite(one[0]); });
  const std::size_t count = colors.size();
  if (count == 0) return {NOWHERE, NOWHERE, NOWHERE};
  Color out;
  if (count > FEW) {
    std::vector<double> values(count);
    for (Index c = 0; c < CHANNELS; ++c) {
      for (std::size_t i = 0; i < count; ++i) values[i] = colors[i][c];
      out[c] = numeric::median_of_many(View<double, 1>(values.data(), {static_cast<Index>(count)}));
    }
    return out;
  }
  for (std::size_t end = count - 1; end > 0; --end)
    for (std::size_t i = 0; i < end; ++i)
      for (Index c = 0; c < CHANNELS; ++c) {
        const double low = std::min(colors[i][c], colors[i + 1][c]);
        colors[i + 1][c] = std::max(colors[i][c], colors[i + 1][c]);
        colors[i][c] = low;
      }
  for (Index c = 0; c < CHANNELS; ++c) out[c] = 0.5 * (colors[(count - 1) / 2][c] + colors[count / 2][c]);
  return out;
}

Color difference(const Color& a, const Color& b) {
  Color out;
  for (Index c = 0; c < CHANNELS; ++c) out[c] = std::max(a[c] - b[c], 0.0);
  return out;
}

// The edges of a cell's triangle from corner 0 to corners 1 and 2.
struct CellBasis {
  double ux, uy, vx, vy;

  CellBasis(const WalkedCells& cells, Index i) {
    const auto corner = cells.corner_px[i];
    const int a = cells.first[i], b = (a + 1) % 3, c = (a + 2) % 3;
    ux = corner(b, 0) - corner(a, 0), uy = corner(b, 1) - corner(a, 1);
    vx = corner(c, 0) - corner(a, 0), vy = corner(c, 1) - corner(a, 1);
  }
};

// The down-cells around a part: a table of axial places.
class DownCells {
 public:
  DownCells(const WalkedCells& cells, const std::vector<Index>& members, const InkFieldLimits& limits) {
    Index high_q = INT32_MIN, high_r = INT32_MIN;
    for (const Index i : members) {
      low_q_ = std::min<Index>(low_q_, cells.axial(i, 0) - REACH);
      low_r_ = std::min<Index>(low_r_, cells.axial(i, 1) - REACH);
      high_q = std::max<Index>(high_q, cells.axial(i, 0) + REACH);
      high_r = std::max<Index>(high_r, cells.axial(i, 1) + REACH);
    }
    columns_ = high_r - low_r_ + 1;
    sums_ = Array<double, 2>({(high_q - low_q_ + 1) * columns_, TERMS}, 0.0);
    const auto steps = steps_within(limits);
    for (const Index i : members) add_predictions(cells, i, steps);
    number_ = Array<std::int32_t, 1>({sums_.size()}, -1);
    for (Index at = 0; at < sums_.size(); ++at)
      if (sums_(at, WEIGHT) > 0.0) {
        number_[at] = static_cast<std::int32_t>(place_.size());
        place_.push_back(at);
      }
    const auto count = static_cast<Index>(place_.size());
    xy_ = Array<double, 2>({count, 2});
    for (Index n = 0; n < count; ++n) {
      const auto sum = sums_[place_[n]];
      xy_(n, 0) = sum[X] / sum[WEIGHT], xy_(n, 1) = sum[Y] / sum[WEIGHT];
    }
  }
  Index size() const { return xy_.size(); }
  Index q(Index n) const { return place_[n] / columns_ + low_q_; }
  Index r(Index n) const { return place_[n] % columns_ + low_r_; }
  View<const double, 2> xy() const { return xy_; }
  // The down-cell's number; -1 for none.
  std::int32_t number(Index q, Index r) const {
    const Index row = q - low_q_, column = r - low_r_;
    if (row < 0 || column < 0 || column >= columns_ || row * columns_ + column >= number_.size()) return -1;
    return number_[row * columns_ + column];
  }

 private:
  static constexpr Index REACH = 3, X = 0, Y = 1, WEIGHT = 2, TERMS = 3;

  // A step from a cell to a down-cell, in axial places and in the cell's edges, and the weight of its place.
  struct Step {
    int dq, dr;
    double q, r, weight;
  };
  static std::vector<Step> steps_within(const InkFieldLimits& limits) {
    std::vector<Step> steps;
    for (int dq = -1; dq <= 2; ++dq)
      for (int dr = -2; dr <= 1; ++dr) {
        const double q = dq - 2.0 / 3.0, r = dr + 1.0 / 3.0, distance2 = q * q + q * r + r * r;
        if (distance2 > limits.place_reach2) continue;
        const double root = limits.place_softening + distance2;
        steps.push_back({dq, dr, q, r, 1.0 / (root * root)});
      }
    return steps;
  }
  // Adds the places of the down-cells up to two steps from a cell, as its triangle predicts them.
  void add_predictions(const WalkedCells& cells, Index i, const std::vector<Step>& steps) {
    const CellBasis basis(cells, i);
    for (const Step& step : steps) {
      const auto sum =
          sums_[(cells.axial(i, 0) + step.dq - low_q_) * columns_ + cells.axial(i, 1) + step.dr - low_r_];
      sum[X] += step.weight * (cells.centre_px(i, 0) + step.q * basis.ux + step.r * basis.vx);
      sum[Y] += step.weight * (cells.centre_px(i, 1) + step.q * basis.uy + step.r * basis.vy);
      sum[WEIGHT] += step.weight;
    }
  }

  Index low_q_ = INT32_MAX, low_r_ = INT32_MAX, columns_ = 0;
  Array<double, 2> sums_, xy_;
  Array<std::int32_t, 1> number_;
  std::vector<Index> place_;
};

// The mean log of each class's share of the light in each channel (3, 3), over the part's cells.
Array<double, 2> shares_of(const std::vector<ColorField>& fields, View<const double, 2> xy,
                           const std::vector<Index>& members, const InkFieldLimits& limits) {
  Array<double, 2> shares({CLASSES, CHANNELS}, 0.0);
  for (const Index i : members) {
    std::array<Color, CLASSES> field;
    for (Index k = 0; k < CLASSES; ++k) field[k] = fields[k].at(xy(i, 0), xy(i, 1));
    for (Index c = 0; c < CHANNELS; ++c) {
      const double most = std::max({field[0][c], field[1][c], field[2][c]});
      double sum = 0.0;
      for (Index k = 0; k < CLASSES; ++k) {
        field[k][c] = std::max(field[k][c], limits.least_share * most + 1e-6);
        sum += field[k][c];
      }
      for (Index k = 0; k < CLASSES; ++k)
        shares(k, c) += std::log(field[k][c] / sum) / static_cast<double>(members.size());
    }
  }
  return shares;
}

// (N, 3) the log likelihoods of the cells' colors for the three classes.
Array<double, 2> odds_of(const std::vector<ColorField>& fields, View<const double, 2> xy,
                         const std::vector<Color>& light, const InkFieldLimits& limits) {
  Array<double, 2> odds({xy.size(), CLASSES}, 0.0);
  for (Index i = 0; i < xy.size(); ++i) {
    if (!std::isfinite(light[i][0])) continue;
    for (Index k = 0; k < CLASSES; ++k) {
      const Color field = fields[k].at(xy(i, 0), xy(i, 1));
      double residual = 0.0, strength = 0.0;
      for (Index c = 0; c < CHANNELS; ++c) {
        residual += std::abs(light[i][c] - field[c]);
        strength += std::max(field[c], 0.0);
      }
      const double ratio =
          residual / std::max(2.0 * fields[k].scatter(), limits.least_scatter * strength + 1e-6);
      odds(i, k) = -0.5 * ratio * ratio;
    }
    // relative to the likeliest class: a color that fits none says nothing
    const double most = std::max({odds(i, 0), odds(i, 1), odds(i, 2)});
    const bool is_known = most > MIN_ODDS;
    for (Index k = 0; k < CLASSES; ++k) odds(i, k) = is_known ? std::max(odds(i, k) - most, MIN_ODDS) : 0.0;
  }
  return odds;
}

double distance(const Color& a, const Color& b) {
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

// From a down-cell's centre to those of the up-cells that share its sides, in steps of the lattice; its
// corners lie on the other sides.
constexpr double THIRD = 1.0 / 3.0;
constexpr double SIDE_STEPS[SIDES][2] = {{2 * THIRD, -THIRD}, {-THIRD, -THIRD}, {-THIRD, 2 * THIRD}};
constexpr Index SIDE_CLASS[SIDES] = {0, 2, 1};  // of these up-cells, relative to the class of the first

// The down-cells' light.
class DownLight {
 public:
  DownLight(const image::PyramidLevel& view, const DownCells& down, const std::vector<ColorField>& fields,
            const InkFieldLimits& limits)
      : view_(view),
        down_(down),
        fields_(fields),
        limits_(limits),
        light_(light_at_points(view, down.xy())) {}

  // (D,) light over that of the down-cells around, relative to the strongest inks there; NaN outside the
  // image. (D,) whether the light fills the triangle of a bright down-cell, and no cell beside it.
  std::pair<Array<double, 1>, Array<bool, 1>> whiteness() const {
    std::vector<Color> around(light_);
    const Color usual = median_color(around);
    Array<double, 1> whiteness({down_.size()}, NOWHERE);
    Array<bool, 1> is_triangle({down_.size()}, false);
    for (Index n = 0; n < down_.size(); ++n) {
      if (!std::isfinite(light_[n][0])) continue;
      around.clear();
      for (const auto& step : NEIGHBOURS) {
        const std::int32_t other = down_.number(down_.q(n) + step[0], down_.r(n) + step[1]);
        if (other >= 0 && std::isfinite(light_[other][0])) around.push_back(light_[other]);
      }
      const Color black = around.size() < 2 ? usual : median_color(around),
                  over = difference(light_[n], black);
      double own = 0.0, most = 0.0;
      Color strongest{};
      for (const ColorField& field : fields_) {
        const Color ink = field.at(down_.xy()(n, 0), down_.xy()(n, 1));
        for (Index c = 0; c < CHANNELS; ++c) strongest[c] = std::max(strongest[c], ink[c]);
      }
      for (Index c = 0; c < CHANNELS; ++c) own += over[c], most += strongest[c];
      whiteness[n] = own / std::max(most, 1e-6);
      is_triangle[n] = whiteness[n] > limits_.bright && fills_triangle(n, black, over);
    }
    return {std::move(whiteness), std::move(is_triangle)};
  }

 private:
  // The step of the lattice from a down-cell, px, by the down-cells on both sides; NaN without any.
  std::array<double, 2> step_px(Index n, Index dq, Index dr) const {
    double x = 0.0, y = 0.0, count = 0.0;
    for (const Index sign : {1, -1}) {
      const std::int32_t other = down_.number(down_.q(n) + sign * dq, down_.r(n) + sign * dr);
      if (other < 0) continue;
      x += static_cast<double>(sign) * (down_.xy()(other, 0) - down_.xy()(n, 0));
      y += static_cast<double>(sign) * (down_.xy()(other, 1) - down_.xy()(n, 1));
      count += 1.0;
    }
    return {x / count, y / count};
  }
  // Whether the light of a down-cell reaches towards its corners, and the cells beside it have their own
  // inks.
  bool fills_triangle(Index n, const Color& black, const Color& white) const {
    const auto u = step_px(n, 1, 0), v = step_px(n, 0, 1);
    Array<double, 2> xy({2 * SIDES, 2});
    for (Index k = 0; k < SIDES; ++k)
      for (int axis = 0; axis < 2; ++axis) {
        const double way = SIDE_STEPS[k][0] * u[axis] + SIDE_STEPS[k][1] * v[axis];
        xy(k, axis) = down_.xy()(n, axis) - limits_.towards_corner * way;
        xy(SIDES + k, axis) = down_.xy()(n, axis) + limits_.across_side * way;
      }
    const auto light = light_at_points(view_, xy);
    const Index first =
        class_of({static_cast<std::int32_t>(down_.q(n)), static_cast<std::int32_t>(down_.r(n))});
    const double full = distance(white, {});
    for (Index k = 0; k < SIDES; ++k) {
      const Color corner = difference(light[k], black), beside = difference(light[SIDES + k], black);
      if (!(distance(corner, white) < limits_.corner_likeness * full)) return false;
      const Color ink = fields_[(first + SIDE_CLASS[k]) % CLASSES].at(xy(SIDES + k, 0), xy(SIDES + k, 1));
      if (!(distance(beside, ink) < distance(beside, white))) return false;
    }
    return true;
  }

  const image::PyramidLevel& view_;
  const DownCells& down_;
  const std::vector<ColorField>& fields_;
  const InkFieldLimits& limits_;
  std::vector<Color> light_;
};

// The share of a part's cells whose color is like that of their class's field.
double fit_of(const std::vector<ColorField>& fields, const WalkedCells& cells,
              const std::vector<Color>& light, const std::vector<Index>& members,
              const InkFieldLimits& limits) {
  double count = 0.0, alike = 0.0;
  for (const Index i : members) {
    if (!std::isfinite(light[i][0])) continue;
    const Color field = fields[class_of({cells.axial(i, 0), cells.axial(i, 1)})].at(cells.centre_px(i, 0),
                                                                                    cells.centre_px(i, 1));
    count += 1.0;
    alike += distance(light[i], field) < limits.likeness * distance(field, {});
  }
  return count > 0.0 ? alike / count : 0.0;
}

std::vector<Color> as_colors(View<const double, 2> light) {
  std::vector<Color> out;
  for (Index i = 0; i < light.size(); ++i) out.push_back({light(i, 0), light(i, 1), light(i, 2)});
  return out;
}

}  // namespace

Array<double, 2> cell_light(const image::PyramidLevel& view, View<const double, 2> centre,
                            View<const double, 3> corner) {
  const Index count = centre.size();
  Array<double, 2> xy({(1 + SIDES) * count, 2}), out({count, CHANNELS}, NOWHERE);
  for (Index i = 0; i < count; ++i)
    for (Index k = 0; k <= SIDES; ++k)
      for (int axis = 0; axis < 2; ++axis)
        // the neighbour across a side lies opposite to a corner, at the same distance
        xy((1 + SIDES) * i + k, axis) =
            k == 0 ? centre(i, axis) : 2.0 * centre(i, axis) - corner(i, k - 1, axis);
  const auto shown = light_at_points(view, xy);
  std::vector<Color> beside;
  for (Index i = 0; i < count; ++i) {
    const auto own = shown.begin() + (1 + SIDES) * i;
    if (!std::isfinite((*own)[0])) continue;
    beside.assign(own + 1, own + 1 + SIDES);
    const Color black = median_color(beside);
    if (!std::isfinite(black[0])) continue;
    const Color light = difference(*own, black);
    std::copy(light.begin(), light.end(), out[i].begin());
  }
  return out;
}

InkFields ink_fields(const image::PyramidLevel& view, const WalkedCells& cells, View<const double, 2> shown,
                     std::int32_t part, const InkFieldLimits& limits) {
  const auto light = as_colors(shown);
  std::vector<Index> members;
  std::array<std::vector<Index>, CLASSES> of_class;
  for (Index i = 0; i < cells.part.size(); ++i) {
    if (cells.part[i] != part) continue;
    members.push_back(i);
    if (std::isfinite(light[i][0])) of_class[class_of({cells.axial(i, 0), cells.axial(i, 1)})].push_back(i);
  }
  std::vector<ColorField> fields;
  for (const auto& own : of_class)
    fields.emplace_back(cells.centre_px, light, own,
                        FieldLimits{limits.residual_scale, limits.robust_rounds, limits.quadratic_cells,
                                    limits.linear_cells});
  const DownCells down(cells, members, limits);
  Array<std::int32_t, 2> axial({down.size(), 2});
  for (Index n = 0; n < down.size(); ++n) {
    axial(n, 0) = static_cast<std::int32_t>(down.q(n));
    axial(n, 1) = static_cast<std::int32_t>(down.r(n));
  }
  auto [whiteness, is_triangle] = DownLight(view, down, fields, limits).whiteness();
  return {shares_of(fields, cells.centre_px, members, limits),
          odds_of(fields, cells.centre_px, light, limits),
          std::move(axial),
          std::move(whiteness),
          std::move(is_triangle),
          fit_of(fields, cells, light, members, limits)};
}

}  // namespace cmp::numbering
