// Gradients by shifts of the gridlines, the gridlines' weights by their misfit, and the markers after a step.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

// Limits of the gridlines' weights, of the noise and of a step.
struct GridlineWeightLimits {
  double min_noise = 0.3;        // gray levels. Derived: rounding alone makes 0.29.
  double prior_hidden_px = 1.0;  // prior deviation of a hidden marker from its prediction. Chosen.
  // of the prior information about a hidden marker; markers with more count for the median information.
  // Chosen.
  double informed_factor = 3.0;
  // of that median; a marker with less does not guide its neighbours' gridlines. Chosen.
  double min_information_share = 0.04;
  // at the rim, a marker with enough weight and a smaller deviation guides them all the same: the map of
  // markers on one side only is less precise. Chosen.
  double rim_deviation_px = 0.05;
  // of the gridlines with weight 1, from which on the noise is that of all gridlines. Chosen.
  double min_clean_share = 0.68;
  // mean weight of the gridlines at a marker, for the marker to count. Chosen.
  double min_marker_weight = 0.3;
  double min_sigma_px = 0.4;     // of the blur. Derived: the bare pixel has 0.29.
  double max_blur_change = 0.3;  // of the blur, in one step. Chosen.
  // of the median misfit, and deviations above it; a misfit up to their sum is explained by chance. Chosen.
  double chance_factor = 1.25, chance_deviations = 5.0;
  // gray levels^2; the least misfit by which is divided. Derived: it only keeps a division from failing.
  double min_misfit = 1e-12;
  // of the squared sum over both ends, and of a gridline without any; the least determinant of a gridline's
  // ends by which is divided. Derived: it only keeps a division from failing.
  double min_determinant_share = 1e-9, min_determinant = 1e-12;
  double min_edge_px = 1.0;  // of the median length of the edges. Chosen.
};

// Gradients of the log-likelihood by shifts of the gridlines' ends, times the noise's variance.
struct ShiftGradients {
  Array<double, 1> start, end;  // (E,) gray levels^2 / px, by a shift of each end along the normal (-uy, ux)

  ShiftGradients copy() const { return {Array<double, 1>(start.view()), Array<double, 1>(end.view())}; }
};

// The weights of the gridlines.
struct GridlineWeights {
  Array<double, 1> weight;  // (E,) 0 to 1
  double median_misfit;     // gray levels^2, NaN where nothing was read
  double noise;             // gray levels, NaN where nothing was read
};

// The markers after a step, (M, 2) px; the same with NaN for markers with little information.
struct ShiftedMarkers {
  Array<double, 2> measured, reliable;
};

// The gradients in the sums (E, 24), copied.
ShiftGradients shift_gradients(View<const double, 2> sums);

// (E,) gray levels^2: the mean squared residual of each gridline once its ends are moved; NaN where there is
// none.
//
// sums (E, 24); values, of each place: 3 for a pixel and 1 for a sample along the contrast; a gridline with
// no more than min_places has no misfit.
Array<double, 1> gridline_misfits(View<const double, 2> sums, const ShiftGradients& gradients, double values,
                                  double min_places, const GridlineWeightLimits& limits);

// (E,) 0 to 1, the weights of gridlines; 1 where the misfit is below the tolerance or explained by chance.
//
// sums (E, 24); misfit (E,) gray levels^2, NaN for none; median_misfit gray levels^2, of gridlines that look
// like the pattern; tolerance (E,) gray levels^2, a misfit that does not lower the weight; values of each
// place; default_weight of gridlines that were read but have no misfit.
Array<double, 1> misfit_weights(View<const double, 2> sums, View<const double, 1> misfit,
                                double median_misfit, View<const double, 1> tolerance, double values,
                                double default_weight, const GridlineWeightLimits& limits);

// gray levels^2, the median of the misfits (E,) that are not NaN; NaN without any.
double median_of_misfits(View<const double, 1> misfit, const GridlineWeightLimits& limits);

// The weights of gridlines, 1 for those that look like the pattern once their ends are moved.
//
// The arguments are those of gridline_misfits and misfit_weights.
GridlineWeights weigh_gridlines(View<const double, 2> sums, const ShiftGradients& gradients,
                                View<const double, 1> tolerance, double values, double min_places,
                                double default_weight, const GridlineWeightLimits& limits);

// (M,), the markers whose gridlines have enough weight (E,); spokes (M, 6).
Array<bool, 1> well_weighted_markers(View<const double, 1> weight, View<const std::int32_t, 2> spokes,
                                     const GridlineWeightLimits& limits);

// The length, px, that all edges exceed except for one in `rarity`; 0 without any known edge.
//
// xy (M, 2) px; edges (E, 2).
double short_edge(View<const double, 2> xy, View<const std::int32_t, 2> edges, Index rarity);

// The median length of the edges (E, 2), px; limits.min_edge_px without any.
double median_edge(View<const double, 2> xy, View<const std::int32_t, 2> edges,
                   const GridlineWeightLimits& limits);

// The change of the blur, px, that the gridlines' pixels ask for, once the ends of each gridline are moved.
//
// sums (E, 24); gridline_weight (E,) 0 to 1.
double blur_change(View<const double, 2> sums, View<const double, 1> gridline_weight,
                   const GridlineWeightLimits& limits);

// The blur, px, where gridlines show a change, px, of the drawn blur sigma, px.
double blur_after_step(double sigma, double change, const GridlineWeightLimits& limits);

// Takes a change of the blur, px, out of the sums (E, 24) and the gradients.
void update_for_blur(View<double, 2> sums, ShiftGradients& gradients, double change);

// (M,) 1/px^2, the information about each of `count` markers in its worst direction, with bending taken as
// known.
//
// sums (E, 24), weight (E,), lines (E, 8), edges (E, 2); variance of the noise, gray levels^2.
Array<double, 1> least_information(View<const double, 2> sums, View<const double, 1> weight,
                                   View<const double, 2> lines, View<const std::int32_t, 2> edges,
                                   double variance, Index count);

// The markers after a step.
//
// xy (M, 2) px; shift (M, 2) px; information (M,) 1/px^2, as least_information gives it; weight (E,) 0 to 1;
// spokes (M, 6).
ShiftedMarkers markers_after_shift(View<const double, 2> xy, View<const double, 2> shift,
                                   View<const double, 1> information, View<const double, 1> weight,
                                   View<const std::int32_t, 2> spokes, const GridlineWeightLimits& limits);

// (4,) px, x from, y from, x to, y to: the part of the image with the pattern and a margin, px.
//
// xy (M, 2) px, NaN where unknown; zeros where no marker is known.
Array<std::int64_t, 1> pattern_box(View<const double, 2> xy, double margin, Index width, Index height);

}  // namespace cmp::refine
