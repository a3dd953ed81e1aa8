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
  DrawingLimits drawing;

  template <class F>
  static SynthesisLimits read(const F& f) {
    return {f["rule"], f["step"], f["dot_gain"], f["drawing"]};
  }
};

// The fields of GridlineReading.
using ReadGridlines = std::tuple<Array<double, 2>, Array<double, 2>, Array<double, 2>, Array<double, 1>,
                                 Array<double, 1>, Array<double, 1>, double, double>;

// The fields of SynthesisStep.
using SynthesisStep = std::tuple<ReadGridlines, SolutionArrays, Array<double, 1>, double, double, LevelArrays,
                                 Array<bool, 1>, double>;

// Draws the pattern into the picture (H, W, 3), compares it with the image, and solves for the markers.
SynthesisStep synthesis_step(const image::PyramidLevel& view, const layout::Topology& topology,
                             View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                             const SynthesisLimits& limits);

}  // namespace cmp::refine
