#include "refine/measure/ink_shift.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "numeric/median.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr double DEVIATION_OF_MEDIAN = 1.4826;       // of a normal variable, over its median distance. Derived.
constexpr double ERROR_OF_MEDIAN = 1.2533141373155;  // of many normal variables, over that of their mean. Derived.

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

// The shifts of cells of one ink, in the layout, and their middle.
struct CellShifts {
  std::vector<double> u, v;
  Vector middle, error;

  void fill_middle() {
    const auto of = [](std::vector<double>& values, double& error) {
      const View<double, 1> all(values.data(), {static_cast<Index>(values.size())});
      const double middle = numeric::median_of_many(all);
      for (double& value : values) value = std::abs(value - middle);
      const double spread = DEVIATION_OF_MEDIAN * numeric::median_of_many(all);
      error = ERROR_OF_MEDIAN * spread / std::sqrt(static_cast<double>(values.size()));
      return middle;
    };
    middle = {of(u, error.x), of(v, error.y)};
  }
};

}  // namespace

Array<double, 2> measure_ink_shift(View<const double, 2> sums, const ShiftGradients& gradients,
                                   View<const double, 2> lines, const PatternState& state,
                                   const layout::Topology& topology, const InkShiftLimits& limits) {
  Array<double, 2> none({SHIFTED_INKS, 2}, 0.0);
  std::array<CellShifts, SHIFTED_INKS> inks;
  double edge_px2 = 0.0, count = 0.0;
  for (Index i = 0; i < topology.cells.size(); ++i) {
    const Index ink = topology.cell_color[i];
    if (ink >= SHIFTED_INKS) continue;
    VectorFit fit;
    bool is_read = true;
    for (Index k = 0; k < 3; ++k) {
      const Index e = topology.cell_edges(i, k);
      const double whole = sums(e, AA) + 2.0 * sums(e, AB) + sums(e, BB);
      is_read = is_read && sums(e, AA) > 0.0 && whole > 0.0;
      if (is_read) fit.add(-lines(e, UY), lines(e, UX), (gradients.start[e] + gradients.end[e]) / whole);
    }
    if (!is_read || !fit.is_determined(limits.min_determinant)) continue;
    const MeanMap map(state.maps, topology.cells[i]);
    if (map.determinant() == 0.0) continue;
    const Vector shift = map.in_layout(fit.solution());
    inks[ink].u.push_back(shift.x);
    inks[ink].v.push_back(shift.y);
    edge_px2 += std::abs(map.determinant());
    count += 1.0;
  }
  Vector mean;
  for (CellShifts& ink : inks) {
    if (static_cast<Index>(ink.u.size()) < limits.min_cells) return none;
    ink.fill_middle();
    mean = {mean.x + ink.middle.x / SHIFTED_INKS, mean.y + ink.middle.y / SHIFTED_INKS};
  }
  Array<double, 2> out({SHIFTED_INKS, 2});
  const auto shift = out.view();
  const double least = limits.min_shift * state.sigma / std::sqrt(edge_px2 / count);
  bool is_seen = false;
  for (Index ink = 0; ink < SHIFTED_INKS; ++ink) {
    const auto& [x, y] = inks[ink].middle;
    shift(ink, 0) = state.ink_shift(ink, 0) + x - mean.x;
    shift(ink, 1) = state.ink_shift(ink, 1) + y - mean.y;
    const double error = limits.deviations * std::hypot(inks[ink].error.x, inks[ink].error.y);
    is_seen = is_seen || std::hypot(shift(ink, 0), shift(ink, 1)) > std::max(least, error);
  }
  return is_seen ? std::move(out) : std::move(none);
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
                              View<const double, 2> shift, const PatternState& state,
                              const layout::Topology& topology) {
  Array<double, 2> change(shift);
  for (Index ink = 0; ink < SHIFTED_INKS; ++ink) {
    for (Index axis = 0; axis < 2; ++axis) change(ink, axis) -= state.ink_shift(ink, axis);
  }
  update_without_offsets(sums, gradients, ink_offsets(change, lines, state.maps, topology));
}

void update_with_offsets(View<double, 2> lines, View<const double, 1> offset) {
  for (Index e = 0; e < lines.size(); ++e) {
    lines(e, X) -= lines(e, UY) * offset[e];
    lines(e, Y) += lines(e, UX) * offset[e];
  }
}

Array<double, 2> crossing_shifts(View<const double, 2> shift, View<const double, 2> lines,
                                 View<const double, 3> maps, const layout::Topology& topology,
                                 const InkShiftLimits& limits) {
  const Array<double, 1> offset = ink_offsets(shift, lines, maps, topology);
  Array<double, 2> out({topology.spokes.size(), 2}, 0.0);
  for (Index m = 0; m < topology.spokes.size(); ++m) {
    VectorFit fit;
    for (Index k = 0; k < topology.spokes.size(1); ++k) {
      const Index e = topology.spokes(m, k);
      if (e < 0 || lines(e, KNOWN) == 0.0 || ink_beside(topology, e) < 0) continue;
      fit.add(-lines(e, UY), lines(e, UX), offset[e]);
    }
    if (!fit.is_determined(limits.min_determinant)) continue;
    const auto [x, y] = fit.solution();
    out(m, 0) = x;
    out(m, 1) = y;
  }
  return out;
}

}  // namespace cmp::refine
