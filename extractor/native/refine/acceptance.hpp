// The final tests of markers, and the treatment of those that are covered.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/solve/fisher_information.hpp"

namespace cmp::refine {

// Limits of accepted markers; explained in extractor/refine/acceptance.py.
struct AcceptanceLimits {
  double max_shift, max_shift_all_cells, max_deviation, min_information, bend_to_end_shift;
  InformationLimits information;

  template <class F>
  static AcceptanceLimits read(const F& f) {
    return {f["max_shift"],       f["max_shift_all_cells"], f["max_deviation"],
            f["min_information"], f["bend_to_end_shift"],   f["information"]};
  }
};

// Limits of markers that dirt hides; explained in extractor/refine/acceptance.py.
struct HiddenMarkerLimits {
  double max_shift_unexplained, max_shift_from_prediction, dot_gain_factor, unexplained_deviation,
      dirt_deviation;
  double disagreement_scale, max_place_error;

  template <class F>
  static HiddenMarkerLimits read(const F& f) {
    return {f["max_shift_unexplained"], f["max_shift_from_prediction"],
            f["dot_gain_factor"],       f["unexplained_deviation"],
            f["dirt_deviation"],        f["disagreement_scale"],
            f["max_place_error"]};
  }
};

// Limits of both; explained in extractor/refine/acceptance.py.
struct FinalLimits {
  double unexplained_noise_ratio;
  AcceptanceLimits acceptance;
  HiddenMarkerLimits hidden;

  template <class F>
  static FinalLimits read(const F& f) {
    return {f["unexplained_noise_ratio"], f["acceptance"], f["hidden"]};
  }
};

// The markers as the last step left them.
struct SolvedMarkers {
  View<const double, 2> measured, reliable;  // (M, 2) px; reliable: NaN where the image shows a marker little
  Information information;
  View<const double, 1> bend_variance;        // (E,) px^2
  View<const double, 1> weight;               // (E,) 0 to 1, of the gridlines, 0 where nothing was measured
  double noise, pixel_noise;                  // gray levels, one channel
  double dot_gain;                            // px
  View<const double, 3> convergence_cov_px2;  // (M, 2, 2) of the error that the last step left

  template <class F>
  static SolvedMarkers read(const F& f) {
    return {f["measured"], f["reliable"],    f["information"], f["bend_variance"],      f["weight"],
            f["noise"],    f["pixel_noise"], f["dot_gain"],    f["convergence_cov_px2"]};
  }
};

// xy_px, cov_px2, unaccepted and all_accepted of FinalMarkers.
using FinalMarkers = std::tuple<Array<double, 2>, Array<double, 3>, Array<bool, 1>, bool>;

// Tests all markers. Where the drawing explains nothing well, markers far from their start are not accepted.
FinalMarkers accept_markers(const SolvedMarkers& solved, const StartPlaces& places,
                            const layout::Topology& topology, const FinalLimits& limits);

// Markers (M, 2) px and covariances (M, 2, 2) px^2, NaN where not accepted.
using AcceptedMarkers = std::tuple<Array<double, 2>, Array<double, 3>>;

// The markers that lie near their start place with a small deviation.
//
// measured (M, 2) px; information about them; bend_variance (E,) px^2; edges (E, 2) and spokes (M, 6);
// selected (M,), the markers to test; no other is accepted.
AcceptedMarkers accepted_markers(View<const double, 2> measured, const Information& information,
                                 View<const double, 1> bend_variance, View<const std::int32_t, 2> edges,
                                 View<const std::int32_t, 2> spokes, const StartPlaces& places,
                                 View<const bool, 1> selected, const AcceptanceLimits& limits);

// (M,), the lost markers: with a start, and not accepted.
//
// xy (M, 2) px and cov (M, 2, 2) px^2: unaccepted markers (M,) far from where they are predicted (M, 2)
// become NaN.
Array<bool, 1> update_lost_markers(View<double, 2> xy, View<double, 3> cov, View<const bool, 1> unaccepted,
                                   View<const double, 2> predicted, View<const double, 2> start,
                                   View<const double, 1> edge, const HiddenMarkerLimits& limits);

// Puts covered markers between the places by profiles, xy (M, 2) px and cov (M, 2, 2) px^2, and those by
// triangles; NaN where these differ much.
void update_obstructed_markers(View<double, 2> xy, View<double, 3> cov, View<const bool, 1> selected,
                               const StartPlaces& places, const HiddenMarkerLimits& limits);

}  // namespace cmp::refine
