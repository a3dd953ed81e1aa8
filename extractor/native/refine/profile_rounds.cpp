#include "refine/profile_rounds.hpp"

#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// (E,) 0 to 1: weights of gridlines that are judged only around markers where little else is measured.
Array<double, 1> lenient_weights(View<const double, 1> profile_weight, View<const double, 2> sums,
                                 View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes,
                                 const OutlierLimits& limits) {
  Array<bool, 1> read({sums.size()});
  for (Index e = 0; e < sums.size(); ++e) read[e] = sums(e, AA) > 0.0;
  const Array<bool, 1> suspect = suspect_markers<bool>(profile_weight, read, spokes, limits);
  Array<double, 1> out({edges.size()});
  for (Index e = 0; e < edges.size(); ++e) {
    const bool is_judged = suspect[edges(e, 0)] || suspect[edges(e, 1)];
    out[e] = is_judged ? profile_weight[e] : read[e] ? 1.0 : 0.0;
  }
  return out;
}

// (E,) squared gray levels: the misfit by glare and uneven light that does not lower a gridline's weight.
Array<double, 1> pardoned_misfit(View<const double, 2> clearance, double tolerance) {
  Array<double, 1> out({clearance.size()});
  for (Index e = 0; e < clearance.size(); ++e)
    out[e] = tolerance * tolerance * clearance(e, SQUARED_CONTRAST);
  return out;
}

}  // namespace

ProfileStep profile_step(const image::PyramidLevel& view, View<const double, 2> lines,
                         const EdgeContrasts& across, const PatternState& state,
                         const layout::Topology& topology, Index stations, const ProfileLimits& limits) {
  const auto contrasts = across.contrasts;
  const auto edges = topology.edges, spokes = topology.spokes, edge_cells = topology.edge_cells;
  const auto& rule = limits.rule;
  const Array<bool, 1> bending = bending_gridlines(state.roughness, state.bend, edges);
  Array<double, 2> sums = read_profiles(view, lines, across, state.sigma, bending, stations, limits.rows);
  ShiftGradients gradients = shift_gradients(sums);
  const double dot_gain =
      measure_dot_gain(sums, gradients, contrasts, edge_cells, state.sigma, limits.dot_gain);
  Array<double, 2> ink_shift = measure_ink_shift(sums, gradients, lines, state.ink_shift, state.maps,
                                                 state.sigma, topology, limits.ink_shift);
  update_without_offsets(sums, gradients, dot_gain_offsets(sums, contrasts, edge_cells, dot_gain));
  update_without_ink_shift(sums, gradients, lines, state.ink_shift, ink_shift, state.maps, topology);
  EliminatedBending bent = update_for_bending(
      sums, gradients, {state.bend, state.roughness, state.weight, state.scatter, topology.scatter_bending},
      lines, edges, state.noise, rule, limits.step);
  const Array<double, 1> pardon = pardoned_misfit(across.clearance, limits.misfit_tolerance);
  Array<double, 1> profile_weight =
      weigh_gridlines(sums, gradients, pardon, static_cast<double>(rule.values),
                      static_cast<double>(rule.min_places), rule.default_weight, limits.step.weights)
          .weight;
  Array<double, 1> weight = lenient_weights(profile_weight, sums, edges, spokes, limits.outliers);
  const Array<double, 2> curved = curving(topology.end_couplings, state.scatter.share, bent.response);
  const GridlineSystem system{sums,
                              weight,
                              lines,
                              contrasts,
                              curved,
                              edges,
                              spokes,
                              state.sigma,
                              state.noise * state.noise,
                              state.scatter.share};
  StepSolution solved = solve_step(system, gradients, state.bend,
                                   {topology, state.xy, state.hidden, bent.response}, limits.step);
  return {std::move(profile_weight), std::move(weight), dot_gain, std::move(ink_shift), std::move(solved)};
}

}  // namespace cmp::refine
