// Bending of the gridlines beyond the smooth map: two more unknowns for each gridline, free where markers are
// rough.
//
// A gridline deviates from the map's cubic by t (1 - t) (b + s (1 - 2 t)), t along the chord. Both unknowns
// are eliminated from a gridline's sums before the markers are solved, and computed afterwards.
#pragma once

#include "base/array.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/marker_scatter.hpp"

namespace cmp::refine {

// Limits of bending; explained in extractor/refine/measure/gridline_bending.py.
struct BendingLimits {
  double min_bend_share, max_bend_share, bend_to_end_shift, max_bend_deviation, third_difference_noise;
  double mean_over_median, misfit_tolerance, max_misfit_tolerance, min_significance, max_bend;
  double min_determinant_share, min_information_share, band;

  template <class F>
  static BendingLimits read(const F& f) {
    return {f["min_bend_share"],
            f["max_bend_share"],
            f["bend_to_end_shift"],
            f["max_bend_deviation"],
            f["third_difference_noise"],
            f["mean_over_median"],
            f["misfit_tolerance"],
            f["max_misfit_tolerance"],
            f["min_significance"],
            f["max_bend"],
            f["min_determinant_share"],
            f["min_information_share"],
            f["band"]};
  }
};

// The four markers in a row along each edge.
struct MarkerRows {
  View<const std::int32_t, 2> edges;  // (E, 2) marker ids of the two in the middle
  View<const std::int32_t, 2>
      next_markers;  // (E, 2) marker ids of the one before and the one after, -1 for none
  View<const double, 2>
      third_differences;  // (E, 2) the layout's own third difference, in units of its mean edge
};

// The bending as drawn, and what limits it.
struct BendingPrior {
  View<const double, 2> bend;       // (E, 2) px, b and s as drawn
  View<const double, 1> roughness;  // (M,) px^2, of the markers
  View<const double, 1> weight;     // (E,) 0 to 1, of the gridlines
  MarkerScatter scatter;
  View<const double, 2> scatter_bending;  // (E, 3), the topology's
};

inline constexpr Index HELD = 6, RESPONSE_COLUMNS = 7;  // of update_without_bending

struct ThirdDifference {
  double x, y;  // px
};

// The roughness of the markers, (M,) px^2: the median of the squared third differences along the gridlines at
// a marker and at its neighbours, less the part that noise and the layout itself explain.
//
// By the median, one marker that dirt has moved does not free its gridlines to follow. xy (M, 2) px, NaN
// where unknown; maps (M, 2, 5), as local_maps gives them; diagonal (M, 3) 1/px^2, the information's diagonal
// blocks; spokes (M, 6) and near (M, 18) as in Topology.
Array<double, 1> measure_roughness(View<const double, 2> xy, View<const double, 3> maps,
                                   View<const double, 2> diagonal, const MarkerRows& rows,
                                   View<const std::int32_t, 2> spokes, View<const std::int32_t, 2> near,
                                   const BendingLimits& limits);

// The third difference of the four markers along edge e, less the layout's own (`third`).
inline ThirdDifference third_difference(View<const double, 2> xy, View<const double, 3> maps,
                                        View<const std::int32_t, 2> edges, View<const std::int32_t, 2> ahead,
                                        View<const double, 2> third, Index e) {
  const std::int32_t a = edges(e, 0), b = edges(e, 1), p = ahead(e, 0), q = ahead(e, 1);
  const double u = 0.5 * third(e, 0), v = 0.5 * third(e, 1);
  double x = xy(p, 0) - xy(q, 0) + 3.0 * (xy(b, 0) - xy(a, 0));
  double y = xy(p, 1) - xy(q, 1) + 3.0 * (xy(b, 1) - xy(a, 1));
  x -= u * (maps(a, 0, 0) + maps(b, 0, 0)) + v * (maps(a, 0, 1) + maps(b, 0, 1));
  y -= u * (maps(a, 1, 0) + maps(b, 1, 0)) + v * (maps(a, 1, 1) + maps(b, 1, 1));
  return {x, y};
}

// (E,), the gridlines that bend (E, 2) or have an end with a roughness (M,); edges (E, 2).
Array<bool, 1> bending_gridlines(View<const double, 1> roughness, View<const double, 2> bend,
                                 View<const std::int32_t, 2> edges);

// (E,) px^2, the variance of b and s, from the bending of the gridlines around and from the roughness of the
// ends; 0 where gridlines may not bend.
//
// sums (E, 24), as accumulate_residual_sums gives them; lines (E, 8); edges (E, 2); variance of the noise,
// gray levels^2.
Array<double, 1> estimate_bend_variance(View<const double, 2> sums, const ShiftGradients& gradients,
                                        const BendingPrior& prior, View<const double, 2> lines,
                                        View<const std::int32_t, 2> edges, double variance,
                                        const BendingLimits& limits);

// Eliminates the bending from the gridlines' sums (E, 24) and the gradients.
//
// bend (E, 2) px, b and s as drawn; bend_variance (E,) px^2; variance of the noise, gray levels^2.
// (E, 7): px, the change of b and s with both ends held; px/px, its decrease by a shift of the start, then by
// a shift of the end, along the normal; 0 to 1, how far b is held where the map puts it.
Array<double, 2> update_without_bending(View<double, 2> sums, ShiftGradients& gradients,
                                        View<const double, 2> bend, View<const double, 1> bend_variance,
                                        double variance);

// (E, 2) px, b and s after a shift of the markers (M, 2) px; response is that of update_without_bending.
Array<double, 2> bend_after_shift(View<const double, 2> bend, View<const double, 2> response,
                                  View<const double, 2> shift, View<const double, 2> lines,
                                  View<const std::int32_t, 2> edges, const BendingLimits& limits);

// (E,) gray levels^2, the mean squared residual of one channel that a gridline's remaining bending may make.
//
// bend_variance (E,) px^2, contrasts (E, 3) gray levels, sigma px, the blur.
Array<double, 1> bending_misfit(View<const double, 1> bend_variance, View<const double, 2> contrasts,
                                double sigma, const BendingLimits& limits);

// (M,) the means of values (E,) over the gridlines at each marker, spokes (M, 6); 0 without any.
Array<double, 1> mean_at_markers(View<const double, 1> values, View<const std::int32_t, 2> spokes);

}  // namespace cmp::refine
