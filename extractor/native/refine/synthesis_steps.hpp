// Steps by synthesis: the pattern is drawn and compared with the image, and all markers are solved.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/drawn_pattern.hpp"
#include "refine/estimate.hpp"
#include "refine/refinement_step.hpp"
#include "refine/synthesis/dot_gain.hpp"

namespace cmp::refine {

// Limits of a step by synthesis; explained in extractor/refine/synthesis_steps.py.
struct SynthesisLimits {
  MisfitRule rule;
  StepLimits step;
  DotGainLimits dot_gain;

  template <class F>
  static SynthesisLimits read(const F& f) {
    return {f["rule"], f["step"], f["dot_gain"]};
  }
};

// weight, variance_ratio, bend_variance, dot_gain, dot_gain_offset, sigma, noise and solution of
// SynthesisReading.
using SynthesisReading = std::tuple<Array<double, 1>, Array<double, 1>, Array<double, 1>, double,
                                    Array<double, 1>, double, double, SolutionArrays>;

// The measurements along the gridlines of a drawing, and the solution.
SynthesisReading update_and_solve(const Synthesis& drawing, const PatternState& state,
                                  const layout::Topology& topology, const SynthesisLimits& limits);

}  // namespace cmp::refine
