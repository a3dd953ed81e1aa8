// Steps by synthesis: the pattern is drawn and compared with the image, and all markers are solved.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/drawn_pattern.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/refinement_step.hpp"

namespace cmp::refine {

// Limits of a step by synthesis.
struct SynthesisLimits {
  MisfitRule rule = {3, 8, 0.0};  // of the gridlines' weights; a pixel has three values. Chosen.
  StepLimits step;
  DotGainLimits dot_gain;
  DrawingLimits drawing;
};

struct ReadGridlines {
  Array<double, 2> lines, sides, added;                      // (E, 8), (E, 6), (E, 6)
  Array<double, 1> weight, variance_ratio, dot_gain_offset;  // (E,)
  double sigma, noise;                                       // px; gray levels

  CMP_RECORD("extractor.refine.measure.gridline_offsets.GridlineReading", lines, sides, added, weight,
             variance_ratio, dot_gain_offset, sigma, noise)
};

struct SynthesisStep {
  ReadGridlines reading;
  StepSolution solution;
  Array<double, 1> bend_variance;  // (E,) px^2
  double dot_gain;                 // px
  UnevenDotGain uneven_dot_gain;
  double sigma;  // px
  LevelArrays levels;
  Array<bool, 1> is_read;  // (E,)
  double edge_px;

  CMP_RECORD("extractor.refine.synthesis_steps.SynthesisStep", reading, solution, bend_variance, dot_gain,
             uneven_dot_gain, sigma, levels, is_read, edge_px)
};

// Draws the pattern into the picture (H, W, 3), compares it with the image, and solves for the markers.
SynthesisStep synthesis_step(const image::PyramidLevel& view, const layout::Topology& topology,
                             View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                             const SynthesisLimits& limits);

}  // namespace cmp::refine
