// Steps by synthesis: the pattern is drawn and compared with the image, and all markers are solved.
//
// Steps follow each other until a further one would hardly change the markers.
#pragma once

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/drawn_pattern.hpp"
#include "refine/estimate.hpp"
#include "refine/first_estimate.hpp"
#include "refine/measure/dot_gain.hpp"
#include "refine/measure/gridline_offsets.hpp"
#include "refine/measure/ink_shift.hpp"
#include "refine/refinement_step.hpp"
#include "refine/solve/convergence.hpp"

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
  Array<double, 2> lines, contrasts;                                                   // (E, 8), (E, 3)
  Array<double, 3> station_sums;                                                       // (E, m, 2)
  Array<double, 1> weight, variance_ratio, dot_gain_offset, ink_offset, ink_variance;  // (E,)
  double sigma, noise;                                                                 // px; gray levels

  CMP_RECORD("extractor.refine.estimate.GridlineReading", lines, contrasts, station_sums, weight,
             variance_ratio, dot_gain_offset, ink_offset, ink_variance, sigma, noise)
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
  Array<bool, 1> is_read;  // (E,), the gridlines that were read
  double edge_px;          // the median length of the gridlines
};

// Limits of the number of steps.
struct StepsLimits {
  // each over all markers. Chosen: clean pictures take one or two, dirt and scatter up to four.
  Index max_steps = 4;
  // share of the blur, by which blur, dot gain and shifts of inks together change in a step after which no
  // step may follow. Sharp pictures of inks that did not bleed change by 0.01, inks that bled by a tenth of
  // an edge by 0.15 in the second step. Measured: rule "settled appearance".
  double small_change = 0.05;
  // RMS of the gridlines' bending, which the first step does not follow, after which no step may follow, in
  // deviations of a marker. With larger ones, the rim's markers are off. Measured: rule "bent gridlines".
  double small_bend = 2.0;
  // times the square of blur over edge: the share of a usual step that is left after it. Chosen.
  double blur_remainder = 20.0;
  SynthesisLimits step;
  ConvergenceLimits convergence;
};

// The estimate after the last step.
struct Estimate {
  MovedPattern drawn;  // the pattern as it was drawn last
  StepSolution solution;
  Array<double, 1> bend_variance;  // (E,) px^2
  ReadGridlines reading;
  double sigma, noise, dot_gain;  // px; gray levels, one channel; px
  UnevenDotGain uneven_dot_gain;
  Array<double, 2> ink_shift;  // (3, 2) as in PatternState
  LevelArrays levels;
  Array<double, 3> convergence_cov_px2;  // (M, 2, 2) of the error that the last step left

  PatternState state(View<const double, 2> xy, View<const bool, 1> hidden, View<const double, 3> maps) const {
    return {xy,    hidden, maps,     drawn.roughness, solution.bend, reading.weight,
            sigma, noise,  dot_gain, ink_shift,       drawn.scatter};
  }
};

// Draws the pattern into the picture (H, W, 3), compares it with the image, also at `stations` stations of
// each gridline, and solves for the markers.
SynthesisStep synthesis_step(const image::PyramidLevel& view, const layout::Topology& topology,
                             View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                             Index stations, const SynthesisLimits& limits);

// The estimate after steps over all markers, from the first estimate, until a step leaves no more than
// small_remainder, in deviations of a marker, and nothing but the markers has changed.
Estimate synthesis_steps(const image::PyramidLevel& view, const layout::Topology& topology,
                         const FirstEstimate& first, double small_remainder, Index stations,
                         const StepsLimits& limits);

}  // namespace cmp::refine
