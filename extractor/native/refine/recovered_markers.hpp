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

// Limits of the round.
struct RecoveryLimits {
  Index stations = 16;            // of a gridline. Chosen.
  Index reference_interval = 12;  // one of so many other gridlines is read. Chosen.
  // other gridlines for the usual misfit; with fewer, all together give it. Chosen.
  Index min_reference_gridlines = 20;
  ProfileLimits profiles;
  GridlineLimits gridlines;
  AcceptanceLimits acceptance;
  HiddenMarkerLimits hidden;
};

// The markers to fill in.
struct LostMarkers {
  View<const bool, 1> lost;  // (M,)
  View<double, 2> xy;   // (M, 2) px, written; NaN where a lost marker is not accepted, or far from its place
  View<double, 3> cov;  // (M, 2, 2) px^2, likewise
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
