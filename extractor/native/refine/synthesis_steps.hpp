// Steps by synthesis: the pattern is drawn and compared with the image, and all markers are solved.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/drawn_pattern.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/measure/ink_shift.hpp"
#include "refine/refinement_step.hpp"

namespace cmp::refine {

// Limits of a step by synthesis.
struct SynthesisLimits {
  MisfitRule rule = {3, 8, 0.0};  // of the gridlines' weights; a pixel has three values. Chosen.
  StepLimits step;
  DotGainLimits dot_gain;
  InkShiftLimits ink_shift;
  DrawingLimits drawing;
};

struct ReadGridlines {
  Array<double, 2> lines, sides;                             // (E, 8), (E, 6)
  Array<double, 3> station_sums;                             // (E, m, 2)
  Array<double, 1> weight, variance_ratio, dot_gain_offset;  // (E,)
  double sigma, noise;                                       // px; gray levels

  CMP_RECORD("extractor.refine.measure.gridline_offsets.GridlineReading", lines, sides, station_sums, weight,
             variance_ratio, dot_gain_offset, sigma, noise)
};

struct SynthesisStep {
  ReadGridlines reading;
  StepSolution solution;
  Array<double, 1> bend_variance;  // (E,) px^2
  double dot_gain;                 // px
  UnevenDotGain uneven_dot_gain;
  Array<double, 2> ink_shift;  // (3, 2) as in PatternState
  double sigma;                // px
  LevelArrays levels;
  Array<bool, 1> is_read;  // (E,)
  double edge_px;

  CMP_RECORD("extractor.refine.synthesis_steps.SynthesisStep", reading, solution, bend_variance, dot_gain,
             uneven_dot_gain, ink_shift, sigma, levels, is_read, edge_px)
};

// Draws the pattern into the picture (H, W, 3), compares it with the image, also at `stations` stations of
// each gridline, and solves for the markers.
SynthesisStep synthesis_step(const image::PyramidLevel& view, const layout::Topology& topology,
                             View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                             Index stations, const SynthesisLimits& limits);

}  // namespace cmp::refine
