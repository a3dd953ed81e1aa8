#include "refine/measure/marker_scatter.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "numeric/median.hpp"
#include "refine/measure/gridline_bending.hpp"

namespace cmp::refine {

namespace {

// the squares of the coefficients of a difference: of 1, 3, 3, 1 and of 1, 4, 6, 4, 1
constexpr double THIRD_DIFFERENCE_SQUARES = 20.0, FOURTH_DIFFERENCE_SQUARES = 70.0;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

// (E,) the third differences along the gridlines, px, NaN where one of the four markers is not known.
Array<ThirdDifference, 1> third_differences(View<const double, 2> xy, View<const double, 3> maps,
                                            const layout::Topology& topology) {
  const auto next = topology.next_markers;
  Array<ThirdDifference, 1> out({next.size()}, ThirdDifference{NONE, NONE});
  for (Index e = 0; e < next.size(); ++e) {
    if (next(e, 0) < 0 || next(e, 1) < 0) continue;
    out[e] = third_difference(xy, maps, topology.edges, next, topology.third_differences, e);
  }
  return out;
}

// px^2, one axis: the variance of differences, by the median of their squares and by a lower quantile.
struct Variances {
  double median, low;
};

// Squared lengths of normal differences in two axes are exponential, with twice the variance as their mean.
Variances variances_of(View<const ThirdDifference, 1> differences, double quantile) {
  Array<double, 1> squares({differences.size()});
  Index count = 0;
  for (const auto [x, y] : differences) {
    squares[count] = x * x + y * y;
    count += std::isfinite(squares[count]);
  }
  if (count == 0) return {NONE, NONE};
  const auto known = squares.slice(0, count);
  const double median = numeric::median_of_many(known);
  const double low = numeric::select(known, static_cast<Index>(quantile * static_cast<double>(count)));
  return {0.5 * median / std::numbers::ln2, -0.5 * low / std::log1p(-quantile)};
}

// px^2, one axis: the median of the markers' variances by these blocks (M, 3) of the information.
double median_noise(View<const double, 2> diagonal) {
  Array<double, 1> variances({diagonal.size()});
  Index count = 0;
  for (Index m = 0; m < diagonal.size(); ++m) {
    const double xx = diagonal(m, 0), xy = diagonal(m, 1), yy = diagonal(m, 2);
    // steep views tell one axis better than the other: half the trace of the inverse
    variances[count] = 0.5 * (xx + yy) / (xx * yy - xy * xy);
    count += std::isfinite(variances[count]);
  }
  return numeric::median_of_many(variances.slice(0, count));
}

// The fourth differences, px: each between the third differences of an edge and of the one that follows it.
Array<ThirdDifference, 1> fourth_differences(View<const ThirdDifference, 1> third,
                                             const layout::Topology& topology) {
  const auto edges = topology.edges, spokes = topology.spokes, next = topology.next_edges;
  Array<ThirdDifference, 1> out({spokes.size() * spokes.size(1)}, ThirdDifference{NONE, NONE});
  Index count = 0;
  for (Index m = 0; m < spokes.size(); ++m) {
    for (Index k = 0; k < spokes.size(1); ++k) {
      const std::int32_t e = spokes(m, k), f = next(m, k);
      if (e < 0 || f <= e) continue;  // a pair is seen from both of its ends
      const bool is_forward = edges(e, 0) == m;
      const std::int32_t between = edges(e, is_forward ? 1 : 0);
      const double sign = is_forward == (edges(f, 0) == between) ? 1.0 : -1.0;
      out[count++] = {third[f].x - sign * third[e].x, third[f].y - sign * third[e].y};
    }
  }
  return out;
}

}  // namespace

MarkerScatter measure_scatter(View<const double, 2> xy, View<const double, 3> maps,
                              View<const double, 2> diagonal, const layout::Topology& topology,
                              const ScatterLimits& limits) {
  const Array<ThirdDifference, 1> third = third_differences(xy, maps, topology);
  const Variances of_third = variances_of(third, limits.quantile);
  const Variances of_fourth = variances_of(fourth_differences(third, topology), limits.quantile);
  const double independent = (of_fourth.low - limits.smooth_ratio * of_third.low) /
                             (FOURTH_DIFFERENCE_SQUARES - limits.smooth_ratio * THIRD_DIFFERENCE_SQUARES);
  const double variance = independent - limits.noise_allowance * median_noise(diagonal);
  if (!(variance > 0.0)) return {0.0, 0.0};
  return {variance, std::min(FOURTH_DIFFERENCE_SQUARES * variance / of_fourth.median, 1.0)};
}

}  // namespace cmp::refine
