// Markers that contradict their neighbours: dirt that looks like a gridline has moved them.
//
// Two independent criteria must agree: the gridlines of the marker do not look like the pattern, and most
// gridlines through the marker show that the map would be smooth if the marker were moved by one vector. The
// marker then starts again from the moved place. Sharp bends, at the rim of an object or where it slips, give
// vectors that differ from one gridline to the next.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "numbering/marker_places.hpp"
#include "refine/estimate.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// Limits of outliers. The native code has room for two ratios and two shifts.
struct OutlierLimits {
  // of the gridlines measured at a marker, below which the marker is suspect. Chosen.
  double min_mean_weight = 0.55;
  // shift of an outlier over that of the markers around, of a suspect marker and of any other. Chosen.
  std::array<double, 2> outlier_ratios = {3.0, 6.0};
  std::array<double, 2> min_outlier_shifts = {0.02, 0.03};  // the least such shifts, in edges. Chosen.
  // the gridlines of a marker agree on a shift if more than this share of them do. Chosen.
  double min_agreeing_share = 0.7;
  Index min_agreeing_gridlines = 3;  // the same, as a number of gridlines. Chosen.
  // share of a shift, by which the shifts of gridlines that agree may differ. Chosen.
  double agreement_tolerance = 0.5;
  Index extrapolated_rings = 2;  // of outliers that the markers around are continued to. Chosen.
  Index max_rounds = 6;          // an outlier hides the errors of its neighbours. Chosen.
  // in edges, between a marker's place by its neighbours and a correct initial place. Derived: as in
  // marker_places.
  double max_place_error = numbering::MAX_PLACE_ERROR;
  // of the squared least shift; a marker whose largest differences stay below cannot move. Derived: below 1
  // by more than rounding.
  double rounding_allowance = 0.99;
  GridlineLimits gridlines;
};

// The markers as the last step left them, px of the image reduced by `scale`.
struct MeasuredMarkers {
  View<const double, 2> measured, reliable;  // (M, 2) as in Estimate
  View<const bool, 1> hidden;                // (M,)
  View<const double, 3> maps;                // (M, 2, 5) as local_maps gives them
  View<const double, 1> weight;              // (E,) of the gridlines in the step
};

// Markers with outliers at their places; the arrays are empty if nothing was found.
struct CorrectedOutliers {
  bool found;
  Array<double, 2> measured, reliable, xy_px;  // (M, 2)
  Array<bool, 1> agreed, is_intact;            // (M,)
};

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
