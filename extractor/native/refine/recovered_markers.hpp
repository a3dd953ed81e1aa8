// Markers that synthesis has lost, as under dirt and glare, are measured by profiles.
//
// The gridlines at the lost markers are read, weighed and solved for these, between other markers that are
// held, so that the round costs as much as these gridlines. Some gridlines elsewhere show the usual misfit.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/acceptance.hpp"
#include "refine/estimate.hpp"
#include "refine/profile_rounds.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// Limits of the round; explained in extractor/refine/recovered_markers.py.
struct RecoveryLimits {
  Index stations, reference_interval, min_reference_gridlines;
  ProfileLimits profiles;
  GridlineLimits gridlines;
  AcceptanceLimits acceptance;
  HiddenMarkerLimits hidden;

  template <class F>
  static RecoveryLimits read(const F& f) {
    return {f["stations"], f["reference_interval"], f["min_reference_gridlines"],
            f["profiles"], f["gridlines"],          f["acceptance"],
            f["hidden"]};
  }
};

// The markers to fill in.
struct LostMarkers {
  View<const bool, 1> lost;  // (M,)
  View<double, 2> xy;   // (M, 2) px, written; NaN where a lost marker is not accepted, or far from its place
  View<double, 3> cov;  // (M, 2, 2) px^2, likewise

  template <class F>
  static LostMarkers read(const F& f) {
    return {f["lost"], f["xy"], f["cov"]};
  }
};

// Fills in the lost markers whose gridlines look like the pattern.
//
// state, with the pattern where the last step left the markers; contrasts across its gridlines; places before
// refinement, in the view.
void fill_recovered_markers(const image::PyramidLevel& view, const PatternState& state,
                            const EdgeContrasts& contrasts, const StartPlaces& places,
                            const layout::Topology& topology, const LostMarkers& markers,
                            const RecoveryLimits& limits);

}  // namespace cmp::refine
