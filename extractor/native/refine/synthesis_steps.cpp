#include "refine/synthesis_steps.hpp"

#include <cmath>

namespace cmp::refine {

SynthesisReading update_and_solve(const Synthesis& drawing, const PatternState& state,
                                  const layout::Topology& topology, const SynthesisLimits& limits) {
  const auto lines = drawing.lines, contrasts = drawing.contrasts;
  const auto edges = topology.edges, edge_cells = topology.edge_cells;
  const auto& rule = limits.rule;
  const auto& weights = limits.step.weights;
  const double sigma = drawing.sigma;
  Array<double, 2> sums(drawing.sums);
  ShiftGradients gradients = shift_gradients(sums);
  const double blur_px = blur_after_step(sigma, blur_change(sums, state.weight, weights), weights);
  update_for_blur(sums, gradients, blur_px - sigma);
  const double dot_gain = measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma, limits.dot_gain);
  Array<double, 1> dot_gain_offset =
      update_without_dot_gain(sums, gradients, contrasts, edge_cells, dot_gain);
  EliminatedBending bent = update_for_bending(
      sums, gradients, {drawing.bend, state.roughness, state.weight, state.scatter, topology.scatter_bending},
      lines, edges, state.noise, rule, limits.step);
  const Array<double, 1> pardon = bending_misfit(bent.variance, contrasts, sigma, limits.step.bending);
  GridlineWeights weighed =
      weigh_gridlines(sums, gradients, pardon, static_cast<double>(rule.values),
                      static_cast<double>(rule.min_places), rule.default_weight, weights);
  const double noise = std::isfinite(weighed.noise) ? weighed.noise : state.noise;
  const Array<double, 2> curved = curving(topology.end_couplings, state.scatter.share, bent.response);
  const GridlineSystem system{sums,  weighed.weight,  lines, contrasts,     curved,
                              edges, topology.spokes, sigma, noise * noise, state.scatter.share};
  WeighedSolution solved = solve_weighed(system, gradients, drawing.bend,
                                         {topology, state.xy, state.hidden, bent.response}, limits.step);
  return {std::move(weighed.weight),
          std::move(solved.variance_ratio),
          std::move(bent.variance),
          dot_gain,
          std::move(dot_gain_offset),
          blur_px,
          noise,
          as_tuple(std::move(solved.solution))};
}

}  // namespace cmp::refine
