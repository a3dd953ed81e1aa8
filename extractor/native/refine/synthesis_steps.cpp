#include "refine/synthesis_steps.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// The thread's memory for the drawing of an image of a shape (H, W, 3). Outside the box that a step draws it
// keeps numbers of earlier drawings.
View<float, 3> kept_picture(std::array<Index, 3> shape) {
  static thread_local std::vector<float> memory;
  const auto size = static_cast<std::size_t>(shape[0] * shape[1] * shape[2]);
  if (memory.size() < size) memory.resize(size);
  return {memory.data(), shape};
}

// The largest difference between two arrays of shifts (3, 2).
double largest_change(View<const double, 2> now, View<const double, 2> before) {
  double largest = 0.0;
  for (Index k = 0; k < now.flat().size(); ++k)
    largest = std::max(largest, std::abs(now.flat()[k] - before.flat()[k]));
  return largest;
}

// Whether the next drawing would differ from the last one by small moves of the markers only. Blur, dot
// gain or shifts of inks that have changed, bending that was not drawn, and markers that scatter are drawn
// otherwise.
bool is_settled(const PatternState& before, const Estimate& after, const SynthesisStep& step,
                const layout::Topology& topology, const StepsLimits& limits) {
  const double change_px = std::abs(step.sigma - before.sigma) + std::abs(step.dot_gain - before.dot_gain) +
                           step.edge_px * largest_change(step.ink_shift, before.ink_shift);
  if (change_px >= limits.small_change * before.sigma) return false;
  const auto& diagonal = step.solution.information.diagonal;
  const bool is_bent = has_any(before.bend);
  if (!is_bent && typical_bending(step.solution.bend, step.is_read, diagonal) >= limits.small_bend)
    return false;
  const auto scatter =
      measure_scatter(step.solution.reliable, after.drawn.maps, diagonal, topology, limits.step.step.scatter);
  return scatter.variance_px2 == 0.0 && scatter.share == 0.0;
}

}  // namespace

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
  const bool is_shifted = has_any(state.ink_shift);
  Array<double, 2> ink_shift = is_shifted ? measure_ink_shift(sums, gradients, lines, state.ink_shift,
                                                              state.maps, sigma, topology, limits.ink_shift)
                                          : Array<double, 2>(state.ink_shift);
  update_without_offsets(sums, gradients, dot_gain_offset);
  update_without_ink_shift(sums, gradients, lines, state.ink_shift, ink_shift, state.maps, topology);
  GridlinesBetween between = gridlines_between(ink_shift, lines, state.maps, topology);
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
                        std::move(contrasts),
                        std::move(read.stations),
                        std::move(weighed.weight),
                        std::move(solved.variance_ratio),
                        std::move(dot_gain_offset),
                        std::move(between.offset),
                        std::move(between.variance),
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

Estimate synthesis_steps(const image::PyramidLevel& view, const layout::Topology& topology,
                         const FirstEstimate& first, double small_remainder, Index stations,
                         const StepsLimits& limits) {
  const View<float, 3> picture = kept_picture(view.image.shape());
  Array<double, 2> shift(first.measured.shape(), std::numeric_limits<double>::quiet_NaN());
  SteppedMarkers markers{first.measured, first.reliable, first.information};
  View<const double, 2> bend = first.bend;
  View<const double, 1> weight = first.weight;
  View<const double, 2> ink_shift = first.ink_shift;
  InkLevels levels = first.levels;
  double sigma = first.sigma, noise = first.noise, dot_gain = first.dot_gain;
  Estimate out;
  for (Index n = 0; n < limits.max_steps; ++n) {
    MovedPattern drawn = move_pattern(markers, topology, limits.step.step);
    const PatternState state{drawn.xy, drawn.hidden, drawn.maps, drawn.roughness, bend,         weight,
                             sigma,    noise,        dot_gain,   ink_shift,       drawn.scatter};
    SynthesisStep step = synthesis_step(view, topology, picture, state, levels, stations, limits.step);
    const double ratio = sigma / step.edge_px;
    StepRemainder rest = step_remainder(step.solution.measured, drawn.xy, shift, sigma,
                                        limits.blur_remainder * (ratio * ratio),
                                        step.solution.information.diagonal, limits.convergence);
    shift = std::move(rest.shift);
    out.drawn = std::move(drawn);
    const bool is_last = rest.error < small_remainder && is_settled(state, out, step, topology, limits);
    out.solution = std::move(step.solution);
    out.bend_variance = std::move(step.bend_variance);
    out.reading = std::move(step.reading);
    out.sigma = step.sigma, out.noise = out.reading.noise, out.dot_gain = step.dot_gain;
    out.uneven_dot_gain = step.uneven_dot_gain;
    out.ink_shift = std::move(step.ink_shift);
    out.levels = std::move(step.levels);
    out.convergence_cov_px2 = std::move(rest.cov_px2);
    if (is_last) break;
    markers = {out.solution.measured, out.solution.reliable, out.solution.information};
    bend = out.solution.bend, weight = out.reading.weight, levels = levels_of(out.levels);
    sigma = out.sigma, noise = out.noise, dot_gain = out.dot_gain, ink_shift = out.ink_shift;
  }
  return out;
}

}  // namespace cmp::refine
