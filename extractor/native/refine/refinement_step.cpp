#include "refine/refinement_step.hpp"

#include <cmath>

#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// The equations of a step for the shifts of the markers.
struct Equations {
  const GridlineSystem& system;
  const StepLimits& limits;
  InformationArrays information;
  Array<double, 2> gradient;

  Equations(const GridlineSystem& of, const ShiftGradients& gradients, View<const bool, 1> hidden,
            const StepLimits& step)
      : system(of),
        limits(step),
        information(fisher_information(of, prior_information(hidden, step))),
        gradient(refine::gradient(of, gradients.start, gradients.end)) {}

  // The same for sums that include the gridlines' ends, where gridlines share pixels.
  Equations(const GridlineSystem& of, const ShiftGradients& gradients, View<const bool, 1> hidden,
            const SharedPixels& shared, const StepLimits& step)
      : Equations(of, gradients, hidden, step) {
    shared.add_information(of, information.diagonal, information.off_diagonal);
  }

  // The shifts (M, 2) px by a part of the gradient.
  Array<double, 2> solved(View<const double, 2> part) const {
    return solve_shifts(information.diagonal, information.off_diagonal, system.edges, part, gradient,
                        limits.information);
  }

  // The markers after shifts (M, 2) px near the solution and what the gradients leave beside them. One more
  // solution leaves a few hundredths of the shifts, as further ones would.
  StepSolution solution(Array<double, 2> shift, const ShiftGradients& left, View<const double, 2> bend,
                        const CurvedGridlines& curved) {
    const auto lines = system.lines;
    const auto edges = system.edges;
    const Array<double, 2> change =
        solved(remaining_gradient(information, edges, refine::gradient(system, left.start, left.end), shift));
    for (Index m = 0; m < shift.size(); ++m) {
      for (Index axis = 0; axis < 2; ++axis) shift(m, axis) += change(m, axis);
    }
    const Array<double, 1> least =
        least_information(system.sums, system.weight, lines, edges, system.variance, curved.xy.size());
    ShiftedMarkers markers =
        markers_after_shift(curved.xy, shift, least, system.weight, system.spokes, limits.weights);
    return {std::move(markers.measured), std::move(markers.reliable),
            bend_after_shift(bend, curved.bend_response, shift, lines, edges, limits.bending),
            std::move(information)};
  }
};

}  // namespace

ExtrapolatedPattern extrapolate_pattern(View<const double, 2> xy, const layout::Topology& topology,
                                        const GridlineLimits& limits) {
  const auto near = topology.ring_markers;
  const auto offset = topology.ring_vectors;
  Array<double, 3> maps = local_maps(xy, near, offset, topology.derivative_stencil, limits);
  ExtrapolatedMarkers markers = extrapolate_markers(xy, maps, near, offset);
  return {std::move(markers.xy), std::move(markers.predicted), std::move(maps)};
}

MovedPattern move_pattern(const SteppedMarkers& markers, const layout::Topology& topology,
                          const StepLimits& limits) {
  const auto known = markers.reliable, diagonal = markers.information.diagonal;
  auto [xy, hidden, maps] = extrapolate_pattern(known, topology, limits.gridlines);
  Array<double, 1> roughness = measure_roughness(
      known, maps, diagonal, {topology.edges, topology.next_markers, topology.third_differences},
      topology.spokes, topology.ring_markers, limits.bending);
  const MarkerScatter scatter = measure_scatter(known, maps, diagonal, topology, limits.scatter);
  if (scatter.share > 0.0) {
    update_without_rim_curves(maps, topology.spokes);
    // the map of markers that scatter puts a marker farther off than a weak measurement does
    for (Index m = 0; m < xy.size(); ++m) {
      if (!hidden[m] || !std::isfinite(markers.measured(m, 0))) continue;
      for (Index axis = 0; axis < 2; ++axis) xy(m, axis) = markers.measured(m, axis);
    }
  }
  return {std::move(xy), std::move(hidden), std::move(maps), std::move(roughness), scatter};
}

EliminatedBending update_for_bending(View<double, 2> sums, ShiftGradients& gradients,
                                     const BendingPrior& prior, View<const double, 2> lines,
                                     View<const std::int32_t, 2> edges, double noise, const MisfitRule& rule,
                                     const StepLimits& limits) {
  Array<double, 1> bend_variance({sums.size()}, 0.0);
  double variance = 1.0;
  if (has_any(prior.roughness) || has_any(prior.bend)) {
    // a misfit that all gridlines have is not bending; without tolerance, as the variances are still 0
    const double found =
        weigh_gridlines(sums, gradients, bend_variance, static_cast<double>(rule.values),
                        static_cast<double>(rule.min_places), rule.default_weight, limits.weights)
            .noise;
    const double most = std::isfinite(found) ? std::max(noise, found) : noise;
    variance = most * most;
    bend_variance = estimate_bend_variance(sums, gradients, prior, lines, edges, variance, limits.bending);
  }
  if (has_any(prior.bend)) {
    auto response = update_without_bending(sums, gradients, prior.bend, bend_variance, variance);
    return {std::move(bend_variance), std::move(response)};
  }
  Array<double, 2> own(sums);
  ShiftGradients own_gradients = gradients.copy();
  auto response = update_without_bending(own, own_gradients, prior.bend, bend_variance, variance);
  for (Index e = 0; e < sums.size(); ++e) {
    response(e, HELD) = 1.0;
    sums(e, READ_AA) = sums(e, AA);
    sums(e, READ_BB) = sums(e, BB);
  }
  return {std::move(bend_variance), std::move(response)};
}

StepSolution solve_step(const GridlineSystem& system, const ShiftGradients& gradients,
                        View<const double, 2> bend, const CurvedGridlines& curved, const StepLimits& limits) {
  Equations equations(system, gradients, curved.hidden, limits);
  Array<double, 2> shift = equations.solved(equations.gradient);
  const CurvedGradients bent = curved_gradients(system, gradients, curved, shift, limits.gridlines);
  return equations.solution(std::move(shift), bent.others, bend, curved);
}

WeighedSolution solve_weighed(const GridlineSystem& system, const ShiftGradients& gradients,
                              View<const double, 2> bend, const CurvedGridlines& curved,
                              const StepLimits& limits) {
  const SharedPixels shared(system, limits.information.shared);
  const Equations equations(system, gradients, curved.hidden, shared, limits);
  Array<double, 2> shift = equations.solved(equations.gradient);
  CurvedGradients bent = curved_gradients(system, gradients, curved, shift, limits.gridlines);
  shared.update_explained(system, shift, bent.left);
  Array<double, 1> ratio = variance_ratios(system, bent.left, shift, limits.disagreement);
  Array<double, 1> weight({ratio.size()});
  for (Index e = 0; e < weight.size(); ++e) weight[e] = system.weight[e] / ratio[e];
  GridlineSystem weighed = system;
  weighed.weight = weight;
  Equations judged(weighed, gradients, curved.hidden, shared, limits);
  WeighedSolution out{std::move(ratio), judged.solution(std::move(shift), bent.others, bend, curved)};
  const Array<double, 2> of_covariance =
      curving(curved.topology.covariance_couplings, system.scatter_share, curved.bend_response);
  update_curving(out.solution.information, weighed, of_covariance);
  return out;
}

Array<double, 1> prior_information(View<const bool, 1> hidden, const StepLimits& limits) {
  const double of_hidden = 1.0 / (limits.weights.prior_hidden_px * limits.weights.prior_hidden_px);
  const double of_visible = 1.0 / (limits.prior_px * limits.prior_px);
  Array<double, 1> out({hidden.size()});
  for (Index m = 0; m < hidden.size(); ++m) out[m] = hidden[m] ? of_hidden : of_visible;
  return out;
}

}  // namespace cmp::refine
