#include "refine/synthesis_steps.hpp"

#include <algorithm>
#include <cmath>

#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

SynthesisStep synthesis_step(const image::PyramidLevel& view, const layout::Topology& topology,
                             View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                             Index stations, const SynthesisLimits& limits) {
  const double sigma = state.sigma, margin = limits.drawing.margin_sigma * sigma + limits.drawing.margin_px;
  const Array<std::int64_t, 1> box = pattern_box(state.xy, margin, view.image.size(1), view.image.size(0));
  auto [lines, sides, contrasts, added, read, corrected, edge_px] =
      draw_pattern(view, topology, picture, state, levels, box, stations, limits.drawing);
  Array<double, 2>& sums = read.ends;
  const auto edges = topology.edges, edge_cells = topology.edge_cells;
  const auto& rule = limits.rule;
  const auto& weights = limits.step.weights;
  Array<bool, 1> is_read({sums.size()});
  for (Index e = 0; e < is_read.size(); ++e) is_read[e] = sums(e, AA) > 0.0;
  ShiftGradients gradients = shift_gradients(sums);
  const double blur_px = blur_after_step(sigma, blur_change(sums, state.weight, weights), weights);
  update_for_blur(sums, gradients, blur_px - sigma);
  const double dot_gain = measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma, limits.dot_gain);
  const UnevenDotGain uneven = measure_uneven_dot_gain(
      sums, gradients, contrasts, state.xy, topology, static_cast<double>(view.image.size(1)),
      static_cast<double>(view.image.size(0)), limits.dot_gain);
  Array<double, 1> dot_gain_offset = dot_gain_offsets(sums, contrasts, edge_cells, dot_gain);
  // the round of profiles tells whether inks lie off
  const auto drawn = state.ink_shift.flat();
  const bool is_shifted = std::any_of(drawn.begin(), drawn.end(), [](double value) { return value != 0.0; });
  Array<double, 2> ink_shift = is_shifted ? measure_ink_shift(sums, gradients, lines, state.ink_shift,
                                                              state.maps, sigma, topology, limits.ink_shift)
                                          : Array<double, 2>(state.ink_shift);
  update_without_offsets(sums, gradients, dot_gain_offset);
  update_without_ink_shift(sums, gradients, lines, state.ink_shift, ink_shift, state.maps, topology);
  EliminatedBending bent = update_for_bending(
      sums, gradients, {state.bend, state.roughness, state.weight, state.scatter, topology.scatter_bending},
      lines, edges, state.noise, rule, limits.step);
  const Array<double, 1> pardon = bending_misfit(bent.variance, contrasts, sigma, limits.step.bending);
  GridlineWeights weighed =
      weigh_gridlines(sums, gradients, pardon, static_cast<double>(rule.values),
                      static_cast<double>(rule.min_places), rule.default_weight, weights);
  const double noise = std::isfinite(weighed.noise) ? weighed.noise : state.noise;
  const Array<double, 2> curved = curving(topology.end_couplings, state.scatter.share, bent.response);
  const GridlineSystem system{sums,  weighed.weight,  lines, contrasts,     curved,
                              edges, topology.spokes, sigma, noise * noise, state.scatter.share};
  WeighedSolution solved = solve_weighed(system, gradients, state.bend,
                                         {topology, state.xy, state.hidden, bent.response}, limits.step);
  LevelArrays after = levels_at_blur(levels_of(corrected), state.xy, topology.cells, topology.cell_color,
                                     sigma, blur_px, limits.drawing.bleed);
  ReadGridlines reading{std::move(lines),
                        std::move(sides),
                        std::move(read.stations),
                        std::move(weighed.weight),
                        std::move(solved.variance_ratio),
                        std::move(dot_gain_offset),
                        sigma,
                        noise};
  return {std::move(reading),
          std::move(solved.solution),
          std::move(bent.variance),
          dot_gain,
          uneven,
          std::move(ink_shift),
          blur_px,
          std::move(after),
          std::move(is_read),
          edge_px};
}

}  // namespace cmp::refine
