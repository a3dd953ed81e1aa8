#include "refine/measure/ink_shift.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "numeric/median.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr double DEVIATION_OF_MEDIAN = 1.4826;  // of a normal variable, over its median distance. Derived.
constexpr double ERROR_OF_MEDIAN =
    1.2533141373155;  // of many normal variables, over that of their mean. Derived.

struct Vector {
  double x = 0.0, y = 0.0;
};

// A vector by its products with unit vectors, by least squares.
class VectorFit {
 public:
  void add(double nx, double ny, double product) {
    xx_ += nx * nx, xy_ += nx * ny, yy_ += ny * ny;
    x_ += nx * product, y_ += ny * product;
  }
  bool is_determined(double min_determinant) const {
    const double trace = xx_ + yy_;
    return determinant() > min_determinant * trace * trace;
  }
  Vector solution() const {
    return {(yy_ * x_ - xy_ * y_) / determinant(), (xx_ * y_ - xy_ * x_) / determinant()};
  }

 private:
  double xx_ = 0.0, xy_ = 0.0, yy_ = 0.0, x_ = 0.0, y_ = 0.0;
  double determinant() const { return xx_ * yy_ - xy_ * xy_; }
};

// The mean of the maps (M, 2, 5) at some markers, from the layout to the image; of none without a known map.
struct MeanMap {
  double xu = 0.0, xv = 0.0, yu = 0.0, yv = 0.0, count = 0.0;

  MeanMap(View<const double, 3> maps, View<const std::int32_t, 1> markers) {
    for (Index k = 0; k < markers.size(); ++k) {
      const auto map = maps[markers[k]];
      if (!std::isfinite(map(0, 0))) continue;
      xu += map(0, 0), xv += map(0, 1), yu += map(1, 0), yv += map(1, 1), count += 1.0;
    }
    const double share = 1.0 / std::max(count, 1.0);
    xu *= share, xv *= share, yu *= share, yv *= share;
  }
  double determinant() const { return xu * yv - xv * yu; }
  Vector in_image(double u, double v) const { return {xu * u + xv * v, yu * u + yv * v}; }
  Vector in_layout(const Vector& to) const {
    return {(yv * to.x - xv * to.y) / determinant(), (xu * to.y - yu * to.x) / determinant()};
  }
};

// The ink beside a gridline; -1 beside none.
Index ink_beside(const layout::Topology& topology, Index e) {
  for (Index k = 0; k < 2; ++k) {
    const Index i = topology.edge_cells(e, k);
    if (i >= 0 && topology.cell_color[i] < SHIFTED_INKS) return topology.cell_color[i];
  }
  return -1;
}

// The shift of a cell in the image, px, by its three sides (3,); none where one is not read.
std::optional<Vector> cell_shift(View<const double, 2> sums, const ShiftGradients& gradients,
                                 View<const double, 2> lines, View<const std::int32_t, 1> sides,
                                 double min_determinant) {
  VectorFit fit;
  for (Index k = 0; k < sides.size(); ++k) {
    const Index e = sides[k];
    const double whole = sums(e, AA) + 2.0 * sums(e, AB) + sums(e, BB);
    if (!(sums(e, AA) > 0.0 && whole > 0.0)) return std::nullopt;
    fit.add(-lines(e, UY), lines(e, UX), (gradients.start[e] + gradients.end[e]) / whole);
  }
  return fit.is_determined(min_determinant) ? std::optional(fit.solution()) : std::nullopt;
}

// The shifts of the cells of one ink, in the layout, and their median with its error.
struct CellShifts {
  Vector middle, error;

  Index size() const { return static_cast<Index>(u_.size()); }
  // px, of a cell
  double edge_px() const { return std::sqrt(area_px2_ / static_cast<double>(size())); }
  void add(const Vector& shift_px, const MeanMap& map) {
    if (map.determinant() == 0.0) return;
    const auto [u, v] = map.in_layout(shift_px);
    u_.push_back(u);
    v_.push_back(v);
    area_px2_ += std::abs(map.determinant());
  }
  void fill_middle() {
    const auto of = [](std::vector<double>& values, double& error) {
      const View<double, 1> all(values.data(), {static_cast<Index>(values.size())});
      const double middle = numeric::median_of_many(all);
      for (double& value : values) value = std::abs(value - middle);
      const double spread = DEVIATION_OF_MEDIAN * numeric::median_of_many(all);
      error = ERROR_OF_MEDIAN * spread / std::sqrt(static_cast<double>(values.size()));
      return middle;
    };
    middle = {of(u_, error.x), of(v_, error.y)};
  }

 private:
  std::vector<double> u_, v_;
  double area_px2_ = 0.0;
};

}  // namespace

Array<double, 2> measure_ink_shift(View<const double, 2> sums, const ShiftGradients& gradients,
                                   View<const double, 2> lines, View<const double, 2> drawn,
                                   View<const double, 3> maps, double sigma, const layout::Topology& topology,
                                   const InkShiftLimits& limits) {
  std::array<CellShifts, SHIFTED_INKS> inks;
  for (Index i = 0; i < topology.cells.size(); ++i) {
    const Index ink = topology.cell_color[i];
    if (ink >= SHIFTED_INKS) continue;
    const auto shift = cell_shift(sums, gradients, lines, topology.cell_edges[i], limits.min_determinant);
    if (shift) inks[ink].add(*shift, MeanMap(maps, topology.cells[i]));
  }
  Array<double, 2> out({SHIFTED_INKS, 2}, 0.0);
  Vector mean;
  for (CellShifts& ink : inks) {
    if (ink.size() < limits.min_cells) return out;
    ink.fill_middle();
    mean = {mean.x + ink.middle.x / SHIFTED_INKS, mean.y + ink.middle.y / SHIFTED_INKS};
  }
  const auto shift = out.view();
  bool is_seen = false;
  for (Index ink = 0; ink < SHIFTED_INKS; ++ink) {
    const CellShifts& own = inks[ink];
    shift(ink, 0) = drawn(ink, 0) + own.middle.x - mean.x;
    shift(ink, 1) = drawn(ink, 1) + own.middle.y - mean.y;
    const double least = std::max(limits.min_shift * sigma / own.edge_px(),
                                  limits.deviations * std::hypot(own.error.x, own.error.y));
    is_seen = is_seen || std::hypot(shift(ink, 0), shift(ink, 1)) > least;
  }
  if (!is_seen) shift.fill(0.0);
  return out;
}

Array<double, 1> ink_offsets(View<const double, 2> shift, View<const double, 2> lines,
                             View<const double, 3> maps, const layout::Topology& topology) {
  Array<double, 1> out({lines.size()}, 0.0);
  const auto all = shift.flat();
  if (std::all_of(all.begin(), all.end(), [](double value) { return value == 0.0; })) return out;
  for (Index e = 0; e < lines.size(); ++e) {
    const Index ink = ink_beside(topology, e);
    if (ink < 0 || lines(e, KNOWN) == 0.0) continue;
    const auto [x, y] = MeanMap(maps, topology.edges[e]).in_image(shift(ink, 0), shift(ink, 1));
    out[e] = lines(e, UX) * y - lines(e, UY) * x;
  }
  return out;
}

void update_without_ink_shift(View<double, 2> sums, ShiftGradients& gradients, View<const double, 2> lines,
                              View<const double, 2> drawn, View<const double, 2> found,
                              View<const double, 3> maps, const layout::Topology& topology) {
  Array<double, 2> change(found);
  for (Index ink = 0; ink < SHIFTED_INKS; ++ink) {
    for (Index axis = 0; axis < 2; ++axis) change(ink, axis) -= drawn(ink, axis);
  }
  update_without_offsets(sums, gradients, ink_offsets(change, lines, maps, topology));
}

void update_with_offsets(View<double, 2> lines, View<const double, 1> offset) {
  for (Index e = 0; e < lines.size(); ++e) {
    lines(e, X) -= lines(e, UY) * offset[e];
    lines(e, Y) += lines(e, UX) * offset[e];
  }
}

GridlinesBetween gridlines_between(View<const double, 2> shift, View<const double, 2> lines,
                                   View<const double, 3> maps, const layout::Topology& topology) {
  GridlinesBetween out{ink_offsets(shift, lines, maps, topology), Array<double, 1>({lines.size()}, 0.0)};
  double largest = 0.0;
  for (Index e = 0; e < lines.size(); ++e) {
    out.offset[e] *= 0.5;
    out.variance[e] = out.offset[e] * out.offset[e];
    largest = std::max(largest, out.variance[e]);
  }
  // beside the white cell, the seen gridline is of two cells
  for (Index e = 0; e < lines.size(); ++e) {
    if (topology.edge_cells(e, 0) >= 0 && topology.edge_cells(e, 1) >= 0) out.variance[e] = largest;
  }
  return out;
}

void update_between_places(View<double, 2> xy, View<double, 3> cov, View<const double, 2> shift,
                           View<const double, 2> lines, View<const double, 3> maps,
                           const layout::Topology& topology, const InkShiftLimits& limits) {
  const auto all = shift.flat();
  if (std::all_of(all.begin(), all.end(), [](double value) { return value == 0.0; })) return;
  const Array<double, 1> offset = ink_offsets(shift, lines, maps, topology);
  for (Index m = 0; m < xy.size(); ++m) {
    VectorFit fit;
    for (Index k = 0; k < topology.spokes.size(1); ++k) {
      const Index e = topology.spokes(m, k);
      if (e < 0 || lines(e, KNOWN) == 0.0 || ink_beside(topology, e) < 0) continue;
      fit.add(-lines(e, UY), lines(e, UX), offset[e]);
    }
    if (!fit.is_determined(limits.min_determinant)) continue;
    const auto [x, y] = fit.solution();
    xy(m, 0) += 0.5 * x;
    xy(m, 1) += 0.5 * y;
    const double variance = 0.125 * (x * x + y * y);
    cov(m, 0, 0) += variance;
    cov(m, 1, 1) += variance;
  }
}

}  // namespace cmp::refine
