// A round of profiles: gridlines are read across, weighed, and the markers solved.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/measure/ink_shift.hpp"
#include "refine/measure/matched_filter.hpp"
#include "refine/outliers.hpp"
#include "refine/refinement_step.hpp"

namespace cmp::refine {

// Limits of a round of profiles.
struct ProfileLimits {
  // of the contrast; what glare and uneven light make in a profile does not lower its weight. Chosen.
  double misfit_tolerance = 0.1;
  MisfitRule rule = {1, 4, 1.0};  // of the gridlines' weights; each sample has one value. Chosen.
  StepLimits step;
  MatchedFilterLimits rows;
  DotGainLimits dot_gain;
  InkShiftLimits ink_shift;
  OutlierLimits outliers;
};

struct ProfileStep {
  Array<double, 1> profile_weight;  // (E,) 0 to 1, similarity of each gridline to the pattern
  Array<double, 1> weight;          // (E,) 0 to 1, with which it was used
  double dot_gain;                  // px
  Array<double, 2> ink_shift;       // (3, 2) as in PatternState
  StepSolution solution;
};

// The measurements of a round of profiles, and the solution.
//
// lines (E, 8), the gridlines; across, the contrasts across them; stations, rows of pixels across each
// gridline at most.
ProfileStep profile_step(const image::PyramidLevel& view, View<const double, 2> lines,
                         const EdgeContrasts& across, const PatternState& state,
                         const layout::Topology& topology, Index stations, const ProfileLimits& limits);

}  // namespace cmp::refine
