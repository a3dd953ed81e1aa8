// The common part of steps of refinement, by profiles or by synthesis: bending of the gridlines, then the
// markers.
#pragma once

#include <algorithm>
#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_bending.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/marker_scatter.hpp"
#include "refine/solve/curved_gridlines.hpp"
#include "refine/solve/disagreement.hpp"
#include "refine/solve/fisher_information.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// How a gridline is weighed by its misfit.
struct MisfitRule {
  Index values, min_places;  // that each pixel or sample adds; pixels or samples, above which it is weighed
  double default_weight;     // of a gridline with fewer

  CMP_FIELDS(values, min_places, default_weight)
};

// Limits of a step.
struct StepLimits {
  double prior_px = 10.0;  // deviation of a marker before it is measured. Chosen.
  GridlineWeightLimits weights;
  BendingLimits bending;
  InformationLimits information;
  DisagreementLimits disagreement;
  GridlineLimits gridlines;
  ScatterLimits scatter;
};

// Whether any value is not zero.
template <int N>
bool has_any(View<const double, N> values) {
  const auto all = values.flat();
  return std::any_of(all.begin(), all.end(), [](double value) { return value != 0.0; });
}

// The bending of the gridlines as it was eliminated.
struct EliminatedBending {
  Array<double, 1> variance;  // (E,) px^2
  Array<double, 2> response;  // (E, 7), as update_without_bending gives it
};

// Markers and gridlines after a step; the arrays as in Estimate.
struct StepSolution {
  Array<double, 2> measured, reliable, bend;
  InformationArrays information;
};

// The same with (E,) the ratio of the variance along each gridline to that of noise.
struct WeighedSolution {
  Array<double, 1> variance_ratio;
  StepSolution solution;
};

struct ExtrapolatedPattern {
  Array<double, 2> xy;    // (M, 2) px
  Array<bool, 1> hidden;  // (M,)
  Array<double, 3> maps;  // (M, 2, 5)

  CMP_RECORD("extractor.refine.extrapolated_pattern.ExtrapolatedPattern", xy, hidden, maps)
};

// The markers (M, 2) px, NaN where unknown, with those just beyond the known ones.
ExtrapolatedPattern extrapolate_pattern(View<const double, 2> xy, const layout::Topology& topology,
                                        const GridlineLimits& limits);

// The markers as a step left them.
struct SteppedMarkers {
  View<const double, 2> measured, reliable;  // (M, 2) px; reliable: NaN where the image shows a marker little
  Information information;
};

// The same with what bends its gridlines.
struct MovedPattern {
  Array<double, 2> xy;
  Array<bool, 1> hidden;
  Array<double, 3> maps;
  Array<double, 1> roughness;  // (M,) px^2
  MarkerScatter scatter;
};

// The pattern at the markers that a step left, and how its gridlines may bend.
MovedPattern move_pattern(const SteppedMarkers& markers, const layout::Topology& topology,
                          const StepLimits& limits);

// Eliminates the bending of gridlines from the sums (E, 24) and the gradients, once bending is drawn.
//
// Before, bending is only measured: the errors of markers look like bending, and markers whose gridlines gave
// way would keep these errors. lines (E, 8) and edges (E, 2); noise, gray levels, one channel.
EliminatedBending update_for_bending(View<double, 2> sums, ShiftGradients& gradients,
                                     const BendingPrior& prior, View<const double, 2> lines,
                                     View<const std::int32_t, 2> edges, double noise, const MisfitRule& rule,
                                     const StepLimits& limits);

// Moves the markers by the shifts that the gradients ask for.
//
// system and gradients, bending eliminated from both; bend (E, 2) px.
StepSolution solve_step(const GridlineSystem& system, const ShiftGradients& gradients,
                        View<const double, 2> bend, const CurvedGridlines& curved, const StepLimits& limits);

// The same for sums that include the gridlines' ends, where they share pixels, with the gridlines' weights
// divided by their variance_ratios.
WeighedSolution solve_weighed(const GridlineSystem& system, const ShiftGradients& gradients,
                              View<const double, 2> bend, const CurvedGridlines& curved,
                              const StepLimits& limits);

// (M,) 1/px^2, the information about each marker before it is measured; hidden (M,).
Array<double, 1> prior_information(View<const bool, 1> hidden, const StepLimits& limits);

}  // namespace cmp::refine
