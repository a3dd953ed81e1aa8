#include "refine/measure/edge_profiles.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "numeric/median.hpp"
#include "refine/measure/matched_filter.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

namespace {

constexpr int BLUR_SAMPLES = 8;       // on each side of a gridline
constexpr int PROFILES = 3;           // across one gridline
constexpr double PROFILE_STEP = 0.1;  // of the gridline, from one profile to the next
constexpr double SMALLEST = 1e-9;     // keeps a division finite
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

double squared(double x) { return x * x; }

// Gridlines to read.
struct ChosenGridlines {
  Array<std::int64_t, 1> numbers;
  Index count;
  bool are_isolated;
};

// The gridlines with a contrast whose middles are clear of other gridlines; where these are few, all with a
// contrast.
ChosenGridlines isolated_gridlines(View<const double, 2> lines, View<const double, 2> clearance,
                                   const EdgeProfileLimits& limits) {
  Array<std::int64_t, 1> isolated({lines.size()}), all({lines.size()});
  Index isolated_count = 0, count = 0;
  for (Index e = 0; e < lines.size(); ++e) {
    if (clearance(e, SQUARED_CONTRAST) == 0.0) continue;
    const double sine = std::min(clearance(e, SINE_A), clearance(e, SINE_B));
    const double distance =
        limits.middle_share * lines(e, LENGTH) * sine / std::sqrt(std::max(1.0 - sine * sine, SMALLEST));
    if (limits.max_reach * clearance(e, HEIGHT) < limits.max_reach_share * distance)
      isolated[isolated_count++] = e;
    all[count++] = e;
  }
  if (isolated_count >= limits.min_blur_gridlines) return {std::move(isolated), isolated_count, true};
  return {std::move(all), count, false};
}

// The light at (x, y), interpolated between four pixels, the channels multiplied by the weights; NaN outside
// the image.
double light_sample(const image::PyramidLevel& view, double x, double y,
                    const std::array<double, 3>& weights) {
  const Index height = view.image.size(0), width = view.image.size(1);
  const double right = static_cast<double>(width) - 1.0, bottom = static_cast<double>(height) - 1.0;
  if (!(x >= 0.0 && y >= 0.0 && x <= right && y <= bottom)) return NONE;
  const Index ix = std::min(static_cast<Index>(x), width - 2),
              iy = std::min(static_cast<Index>(y), height - 2);
  const double from_x = x - static_cast<double>(ix), from_y = y - static_cast<double>(iy);
  double total = 0.0;
  for (Index dy = 0; dy < 2; ++dy) {
    for (Index dx = 0; dx < 2; ++dx) {
      const auto pixel = view.image[iy + dy][ix + dx];
      const double share = (1.0 - std::abs(from_x - static_cast<double>(dx))) *
                           (1.0 - std::abs(from_y - static_cast<double>(dy)));
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const float light = view.response.light[pixel[static_cast<Index>(channel)]];
        total += share * weights[channel] * static_cast<double>(light);
      }
    }
  }
  return total;
}

// The true blur of an apparent one, both in units of the cell's height.
double true_blur(double apparent, const EdgeProfileLimits& limits) {
  const auto &x = limits.apparent_blur, &y = limits.true_blur;
  if (apparent < x.front()) return y.front();
  const auto after = std::upper_bound(x.begin(), x.end(), apparent);
  if (after == x.end()) return y.back();
  const auto j = static_cast<std::size_t>(after - x.begin()) - 1;
  const double slope = (y[j + 1] - y[j]) / (x[j + 1] - x[j]);
  return slope * (apparent - x[j]) + y[j];
}

// px, the integral of f (1 - f) over the profiles f across gridline e, from `beside` px before it to `beside`
// beyond; NaN where these leave the image. line (8,); side (6,), the light on both sides.
double profile_integral(const image::PyramidLevel& view, View<const double, 1> line,
                        View<const double, 1> side, double beside, double middle_share) {
  std::array<double, 3> weights{side[0] - side[3], side[1] - side[4], side[2] - side[5]};
  const double strength = weights[0] * weights[0] + weights[1] * weights[1] + weights[2] * weights[2];
  for (double& weight : weights) weight /= strength;
  const double foot = weights[0] * side[3] + weights[1] * side[4] + weights[2] * side[5];
  const double nx = -line[UY], ny = line[UX], length = line[LENGTH], step = beside / BLUR_SAMPLES;
  double total = 0.0;
  for (int k = 0; k < PROFILES; ++k) {
    const double t = middle_share + PROFILE_STEP * k;
    const double off = sagitta(t, length, line[LEAVE], line[ARRIVE]);
    const double x = line[X] + t * length * line[UX] + off * nx,
                 y = line[Y] + t * length * line[UY] + off * ny;
    for (int m = -BLUR_SAMPLES; m <= BLUR_SAMPLES; ++m) {
      const double f = light_sample(view, x + m * step * nx, y + m * step * ny, weights) - foot;
      total += f * (1.0 - f) * step / PROFILES;
    }
  }
  return total;
}

// Where the corners of the cells beside a gridline lie.
struct CornerSpace {
  double height, at_start, at_end;  // px, of the lower cell; sines of the smallest angles
};

// Narrows the space by the cell (3,), marker ids; line (8,) with the cell beside it; xy (M, 2) px.
void update_space(View<const double, 1> line, View<const std::int32_t, 1> cell, View<const double, 2> xy,
                  CornerSpace& space) {
  const double ux = line[UX], uy = line[UY], length = line[LENGTH];
  double off = 0.0, along = 0.0;
  for (const std::int32_t corner : cell) {
    const double dx = xy(corner, 0) - line[X], dy = xy(corner, 1) - line[Y];
    if (std::abs(dy * ux - dx * uy) > std::abs(off)) {
      off = dy * ux - dx * uy;
      along = dx * ux + dy * uy;
    }
  }
  off = std::abs(off);
  space.height = std::min(space.height, off);
  if (along > 0.0) space.at_start = std::min(space.at_start, off / std::sqrt(off * off + along * along));
  if (along < length)
    space.at_end = std::min(space.at_end, off / std::sqrt(off * off + squared(length - along)));
}

}  // namespace

Array<double, 2> gridline_clearance(View<const double, 2> lines, View<const double, 2> contrasts,
                                    View<const double, 2> xy, View<const std::int32_t, 2> cells,
                                    View<const std::int32_t, 2> edge_cells, const EdgeProfileLimits& limits) {
  Array<double, 2> clearance({lines.size(), CLEARANCE_COLUMNS}, 0.0);
  for (Index e = 0; e < lines.size(); ++e) {
    const auto line = lines[e], contrast = contrasts[e];
    const auto out = clearance[e];
    const double strength = squared(contrast[0]) + squared(contrast[1]) + squared(contrast[2]);
    if (line[KNOWN] == 0.0 || strength < squared(limits.min_contrast)) continue;
    CornerSpace space{line[LENGTH], 1.0, 1.0};
    for (const std::int32_t i : edge_cells[e]) {
      if (i >= 0) update_space(line, cells[i], xy, space);
    }
    out[HEIGHT] = space.height;
    out[SQUARED_CONTRAST] = strength;
    out[SINE_A] = std::max(space.at_start, limits.min_sine);
    out[SINE_B] = std::max(space.at_end, limits.min_sine);
  }
  return clearance;
}

double profile_blur(const image::PyramidLevel& view, View<const double, 2> lines, const EdgeContrasts& across,
                    Index most, const EdgeProfileLimits& limits) {
  const auto which = isolated_gridlines(lines, across.clearance, limits);
  const Index every = std::max<Index>(which.count / most, 1);
  Array<double, 1> blurs({which.count / every + 1});
  Index count = 0;
  for (Index i = 0; i < which.count; i += every) {
    const Index e = which.numbers[i];
    const double height = across.clearance(e, HEIGHT);
    const double total =
        profile_integral(view, lines[e], across.sides[e], limits.max_reach * height, limits.middle_share);
    if (!std::isfinite(total)) continue;
    const double apparent = total * std::sqrt(std::numbers::pi);
    // the height of a regular cell of the same area
    const double size = std::sqrt(0.5 * std::numbers::sqrt3 * lines(e, LENGTH) * height);
    const double share = std::sqrt(std::max(apparent * std::abs(apparent) - limits.bilinear_px2, 0.0)) / size;
    blurs[count++] = size * true_blur(share, limits);
  }
  if (count == 0) return NONE;
  const auto known = blurs.slice(0, count);
  return which.are_isolated ? numeric::median_of_many(known) : numeric::select(known, count / 4);
}

}  // namespace cmp::refine
