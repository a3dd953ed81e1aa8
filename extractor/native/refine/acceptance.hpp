// The final tests of markers, and the treatment of those that are covered.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "numbering/marker_places.hpp"
#include "refine/estimate.hpp"
#include "refine/refinement_step.hpp"
#include "refine/solve/fisher_information.hpp"

namespace cmp::refine {

// Limits of accepted markers, in units of the edges around the marker where nothing else is said.
struct AcceptanceLimits {
  double max_shift = 0.25;  // from the start place. Chosen.
  // the same where all triangles agree on that: in steep views these lie so far off. Chosen.
  double max_shift_all_cells = 0.13;
  // of what is measured. Chosen: as many markers at the rim are accepted as with 0.03, when their deviations
  // were stated as if they had neighbours on all sides.
  double max_deviation = 0.035;
  // 1/px^2, below which a marker counts as unknown: four times that before the measurement. Derived.
  double min_information = 4.0 / (StepLimits{}.prior_px * StepLimits{}.prior_px);
  // the shift of a gridline's ends that remains, in deviations of its bending. Derived: as in BendingLimits.
  double bend_to_end_shift = BendingLimits{}.bend_to_end_shift;
  InformationLimits information;
};

// Limits of markers that dirt hides, in units of the edges around the marker where nothing else is said.
struct HiddenMarkerLimits {
  // from the start place, where the drawing explains nothing well. Chosen.
  double max_shift_unexplained = 0.13;
  double max_shift_from_prediction = 0.05;  // from where the neighbours put an unaccepted marker. Chosen.
  // times the dot gain, added to max_shift_unexplained: corners move most. Chosen.
  double dot_gain_factor = 2.0;
  // by dirt, of the visible part where the drawing does not explain the image. Chosen.
  double unexplained_deviation = 0.015;
  // by dirt, where it does, but no gridline of the marker has any weight. Chosen.
  double dirt_deviation = 0.01;
  // of profiles and triangles, where all triangles of a marker were found. Chosen.
  double disagreement_scale = 0.03;
  // between a marker's place by its gridlines and a correct initial place. Derived: as in marker_places.
  double max_place_error = numbering::MAX_PLACE_ERROR;
};

// Limits of the markers after the last step.
struct FinalLimits {
  // noise of the drawing over that of the pixels, above which the drawing explains too little to move a
  // marker far. Chosen.
  double unexplained_noise_ratio = 3.0;
  AcceptanceLimits acceptance;
  HiddenMarkerLimits hidden;
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
};

// The M markers after the tests.
struct FinalMarkers {
  Array<double, 2> xy_px;     // (M, 2) NaN where not accepted
  Array<double, 3> cov_px2;   // (M, 2, 2) likewise
  Array<bool, 1> unaccepted;  // (M,)
  bool all_accepted;
};

// Tests all markers. Where the drawing explains nothing well, markers far from their start are not accepted.
FinalMarkers accept_markers(const SolvedMarkers& solved, const StartPlaces& places,
                            const layout::Topology& topology, const FinalLimits& limits);

// Markers (M, 2) px and covariances (M, 2, 2) px^2, NaN where not accepted.
struct AcceptedMarkers {
  Array<double, 2> xy_px;
  Array<double, 3> cov_px2;
};

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
