// A round of profiles: gridlines are read across, weighed, and the markers solved.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/matched_filter.hpp"
#include "refine/outliers.hpp"
#include "refine/refinement_step.hpp"
#include "refine/synthesis/dot_gain.hpp"

namespace cmp::refine {

// Limits of a round of profiles; explained in extractor/refine/profile_rounds.py.
struct ProfileLimits {
  double misfit_tolerance;
  MisfitRule rule;
  StepLimits step;
  MatchedFilterLimits rows;
  DotGainLimits dot_gain;
  OutlierLimits outliers;

  template <class F>
  static ProfileLimits read(const F& f) {
    return {f["misfit_tolerance"], f["rule"], f["step"], f["rows"], f["dot_gain"], f["outliers"]};
  }
};

// profile_weight, weight, dot_gain and solution of ProfileStep.
using ProfileStep = std::tuple<Array<double, 1>, Array<double, 1>, double, SolutionArrays>;

// The measurements of a round of profiles, and the solution.
//
// lines (E, 8), the gridlines; across, the contrasts across them; stations, rows of pixels across each
// gridline at most.
ProfileStep profile_step(const image::PyramidLevel& view, View<const double, 2> lines,
                         const EdgeContrasts& across, const PatternState& state,
                         const layout::Topology& topology, Index stations, const ProfileLimits& limits);

}  // namespace cmp::refine
