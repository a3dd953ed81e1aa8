#include "refine/solve/disagreement.hpp"

#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// The sums of a gridline over its pixels by its two ends.
struct EndSums {
  double aa, ab, bb;

  EndSums(View<const double, 2> sums, Index e) : aa(sums(e, AA)), ab(sums(e, AB)), bb(sums(e, BB)) {}
  double determinant() const { return aa * bb - ab * ab; }
  // the measurement tells the two ends apart
  bool are_independent(double min_determinant) const { return determinant() > min_determinant * aa * bb; }
  double at(Index side) const { return side == 0 ? aa : bb; }
};

// The ratio of the picture, and how much each gridline counts (E,).
struct PictureRatio {
  double ratio;
  Array<double, 1> count;
};

// (E,) squared distances of the gridlines' own places from those that the shifts (M, 2) give them, in units
// of the noise; 0 for gridlines without weight.
Array<double, 1> squared_distances(const GridlineSystem& system, const ShiftGradients& gradients,
                                   View<const double, 2> shift, const DisagreementLimits& limits) {
  const auto lines = system.lines;
  const auto edges = system.edges;
  Array<double, 1> out({edges.size()}, 0.0);
  for (Index e = 0; e < edges.size(); ++e) {
    const EndSums sums(system.sums, e);
    const double weight = system.weight[e] * lines(e, KNOWN);
    if (weight == 0.0 || !sums.are_independent(limits.min_determinant)) continue;
    const double nx = -lines(e, UY), ny = lines(e, UX);
    const Index a = edges(e, 0), b = edges(e, 1);
    const double start = nx * shift(a, 0) + ny * shift(a, 1), end = nx * shift(b, 0) + ny * shift(b, 1);
    const double left_a = gradients.start[e] - sums.aa * start - sums.ab * end;
    const double left_b = gradients.end[e] - sums.ab * start - sums.bb * end;
    const double square =
        (sums.bb * (left_a * left_a) - 2.0 * sums.ab * left_a * left_b + sums.aa * (left_b * left_b)) /
        sums.determinant();
    out[e] = std::min(weight * square / system.variance, limits.max_square);
  }
  return out;
}

// (M, 3) xx, xy, yy: what the gridlines at each marker tell about it, each end by itself.
Array<double, 2> end_blocks(const GridlineSystem& system) {
  const auto lines = system.lines;
  const auto edges = system.edges;
  Array<double, 2> out({system.spokes.size(), 3}, 0.0);
  const auto blocks = out.view();
  for (Index e = 0; e < edges.size(); ++e) {
    const EndSums sums(system.sums, e);
    const double nx = -lines(e, UY), ny = lines(e, UX), known = system.weight[e] * lines(e, KNOWN);
    for (Index side = 0; side < 2; ++side) {
      const Index m = edges(e, side);
      const double value = known * sums.at(side);
      blocks(m, 0) += value * nx * nx;
      blocks(m, 1) += value * nx * ny;
      blocks(m, 2) += value * ny * ny;
    }
  }
  return out;
}

// (E,) two of each gridline with weight, less the shares of its ends in the two unknowns of each marker.
Array<double, 1> degrees_of_freedom(const GridlineSystem& system, const DisagreementLimits& limits) {
  const auto lines = system.lines;
  const auto edges = system.edges;
  const Array<double, 2> blocks = end_blocks(system);
  Array<double, 1> out({edges.size()}, 0.0);
  for (Index e = 0; e < edges.size(); ++e) {
    const EndSums sums(system.sums, e);
    const double nx = -lines(e, UY), ny = lines(e, UX), known = system.weight[e] * lines(e, KNOWN);
    if (known == 0.0 || !sums.are_independent(limits.min_determinant)) continue;
    double freedom = 2.0;
    for (Index side = 0; side < 2; ++side) {
      const Index m = edges(e, side);
      const double value = known * sums.at(side), xx = blocks(m, 0), cross = blocks(m, 1), yy = blocks(m, 2);
      const double determinant = xx * yy - cross * cross, trace = xx + yy;
      // gridlines in one direction tell one unknown
      const double share = determinant > limits.min_block_determinant * trace * trace
                               ? (yy * nx * nx - 2.0 * cross * nx * ny + xx * ny * ny) * value / determinant
                               : value / trace;
      freedom -= std::min(share, 1.0);
    }
    out[e] = std::max(freedom, limits.min_freedom);
  }
  return out;
}

// The squared distances (E,) over the degrees of freedom (E,); large ones count less.
PictureRatio ratio_of_picture(View<const double, 1> square, View<const double, 1> freedom,
                              const DisagreementLimits& limits) {
  PictureRatio found{1.0, Array<double, 1>({square.size()}, 1.0)};
  const auto count = found.count.view();
  const double tail = limits.tail_freedom;
  for (Index round = 0; round < limits.rounds; ++round) {
    double above = 0.0, below = 0.0;
    for (Index e = 0; e < square.size(); ++e) {
      count[e] = (tail + freedom[e]) / (tail + square[e] / found.ratio);
      above += count[e] * square[e];
      below += freedom[e];
    }
    if (!(above > 0.0 && below > 0.0)) break;
    found.ratio = above / below;
  }
  return found;
}

// Whether gridline e ends at a marker with fewer gridlines than inside the pattern.
bool ends_at_rim(const GridlineSystem& system, Index e) {
  const Index last = system.spokes.size(1) - 1;
  return system.spokes(system.edges(e, 0), last) < 0 || system.spokes(system.edges(e, 1), last) < 0;
}

}  // namespace

Array<double, 1> variance_ratios(const GridlineSystem& system, const ShiftGradients& gradients,
                                 View<const double, 2> shift, const DisagreementLimits& limits) {
  const auto edges = system.edges;
  const Array<double, 1> squares = squared_distances(system, gradients, shift, limits);
  const Array<double, 1> freedoms = degrees_of_freedom(system, limits);
  const PictureRatio picture = ratio_of_picture(squares, freedoms, limits);
  const auto square = squares.view(), freedom = freedoms.view(), count = picture.count.view();
  Array<double, 1> at_square({system.spokes.size()}, 0.0), at_freedom({system.spokes.size()}, 0.0);
  std::array<double, 2> side_square{},
      side_freedom{};  // of the gridlines inside, and of those that end at the rim
  for (Index e = 0; e < edges.size(); ++e) {
    const Index side = ends_at_rim(system, e) ? 1 : 0;
    side_square[side] += count[e] * square[e];
    side_freedom[side] += freedom[e];
    for (Index end = 0; end < 2; ++end) {
      at_square[edges(e, end)] += count[e] * square[e];
      at_freedom[edges(e, end)] += freedom[e];
    }
  }
  // gridlines that are free to bend agree better than noise alone makes them
  const double least = system.scatter_share > 0.0 ? 1.0 : limits.min_ratio;
  Array<double, 1> out({edges.size()});
  for (Index e = 0; e < edges.size(); ++e) {
    const Index a = edges(e, 0), b = edges(e, 1), side = ends_at_rim(system, e) ? 1 : 0;
    const double around = (limits.picture_freedom * picture.ratio + side_square[side]) /
                          (limits.picture_freedom + side_freedom[side]);
    const double own_square =
        limits.picture_freedom * around + at_square[a] + at_square[b] - count[e] * square[e];
    const double own_freedom = limits.picture_freedom + at_freedom[a] + at_freedom[b] - freedom[e];
    out[e] = std::max(own_square / own_freedom, least);
  }
  return out;
}

}  // namespace cmp::refine
