// Markers that contradict their neighbours: dirt that looks like a gridline has moved them.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// Limits of outliers; explained in extractor/refine/outliers.py.
struct OutlierLimits {
  double min_mean_weight;
  std::array<double, 2> outlier_ratios, min_outlier_shifts;  // of a suspect marker and of any other
  double min_agreeing_share;
  Index min_agreeing_gridlines;
  double agreement_tolerance;
  Index extrapolated_rings, max_rounds;
  double max_place_error, rounding_allowance;
  GridlineLimits gridlines;

  template <class F>
  static OutlierLimits read(const F& f) {
    return {f["min_mean_weight"],
            f["outlier_ratios"],
            f["min_outlier_shifts"],
            f["min_agreeing_share"],
            f["min_agreeing_gridlines"],
            f["agreement_tolerance"],
            f["extrapolated_rings"],
            f["max_rounds"],
            f["max_place_error"],
            f["rounding_allowance"],
            f["gridlines"]};
  }
};

// The markers as the last step left them, px of the image reduced by `scale`.
struct MeasuredMarkers {
  View<const double, 2> measured, reliable;  // (M, 2) as in Estimate
  View<const bool, 1> hidden;                // (M,)
  View<const double, 3> maps;                // (M, 2, 5) as local_maps gives them
  View<const double, 1> weight;              // (E,) of the gridlines in the step

  template <class F>
  static MeasuredMarkers read(const F& f) {
    return {f["measured"], f["reliable"], f["hidden"], f["maps"], f["weight"]};
  }
};

// found; measured and reliable (M, 2); xy_px (M, 2), agreed (M,) and is_intact (M,) of the places. The arrays
// are empty if nothing was found.
using CorrectedOutliers =
    std::tuple<bool, Array<double, 2>, Array<double, 2>, Array<double, 2>, Array<bool, 1>, Array<bool, 1>>;

// (M,), the markers whose gridlines with a positive weight (E,) have little profile_weight (E,); spokes (M,
// 6).
template <class Weight>
Array<bool, 1> suspect_markers(View<const double, 1> profile_weight, View<const Weight, 1> weight,
                               View<const std::int32_t, 2> spokes, const OutlierLimits& limits) {
  Array<bool, 1> out({spokes.size()});
  for (Index m = 0; m < spokes.size(); ++m) {
    double total = 0.0;
    Index count = 0;
    for (Index k = 0; k < spokes.size(1); ++k) {
      const std::int32_t e = spokes(m, k);
      if (e >= 0 && weight[e] > Weight{0}) {
        total += profile_weight[e];
        ++count;
      }
    }
    out[m] = total < limits.min_mean_weight * static_cast<double>(count);
  }
  return out;
}

// Puts the outliers where their neighbours predict them.
//
// The markers are px of the image reduced by scale, the places of the full image; profile_weight is (E,).
CorrectedOutliers correct_outliers(const layout::Topology& topology, const MeasuredMarkers& markers,
                                   const StartPlaces& places, View<const double, 1> profile_weight,
                                   double scale, const OutlierLimits& limits);

}  // namespace cmp::refine
