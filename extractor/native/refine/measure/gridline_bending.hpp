// Bending of the gridlines beyond the smooth map: two more unknowns for each gridline, free where markers are
// rough.
//
// The map that the markers define is smooth over two rings of markers. Where an object's rim lies between
// markers, or slips, gridlines bend more sharply. The sharpness is limited by the third differences of the
// markers along their gridlines, which are 0 where the map is quadratic. A gridline then deviates from the
// map's cubic by
//
//    t (1 - t) (b + s (1 - 2 t)),
//
// t along the chord, b and s of zero mean and a deviation that is a share of these differences. The share,
// from min_bend_share to max_bend_share, follows from the surrounding gridlines: their bending above the part
// that noise explains. Both unknowns are eliminated from a gridline's sums before the markers are solved, and
// computed afterwards.
#pragma once

#include "base/array.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/marker_scatter.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

// Limits of the bending b and s.
struct BendingLimits {
  // b and s over the differences around them (RMS) where these are smooth, and at most; from the surfaces
  // under balls that press, shear and twist. Measured on these, by no command that is kept.
  double min_bend_share = 0.01, max_bend_share = 0.25;
  // the shift of a gridline's ends that remains, in deviations of b and s; from these surfaces. Measured on
  // them, likewise.
  double bend_to_end_shift = 0.08;
  double max_bend_deviation = 0.06;  // in units of the gridline's length. Chosen.
  // the noise of four markers in a third difference, 1 + 9 + 9 + 1, in two axes, with some allowance for its
  // scatter. Derived: twice 20, times an allowance of 2, which is chosen.
  double third_difference_noise = 2.0 * 20.0 * 2.0;
  // a mean of squares against their median. Chosen near the 2.2 of the square of a normal variable.
  double mean_over_median = 2.0;
  double misfit_tolerance = 25.0;     // five deviations of the shift of the ends, squared. Chosen.
  double max_misfit_tolerance = 0.1;  // the most of that, in units of the blur, squared. Chosen.
  double min_significance = 3.0;      // deviations by which bending must exceed its noise. Chosen.
  double max_bend = 0.3;              // b and s, in units of the gridline's length. Chosen.
  // of the product of the sums at both ends; a gridline whose determinant is smaller does not show bending.
  // Chosen.
  double min_determinant_share = 1e-6;
  // of the information about b with both ends held; a gridline with less does not show bending. Chosen.
  double min_information_share = 0.001;
  // in units of the blur, the distance from a gridline within which pixels count. Derived: as in
  // PixelRowLimits.
  double band = PixelRowLimits{}.band;
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
