#include "refine/recovered_markers.hpp"

#include <cmath>

#include "refine/measure/dot_gain.hpp"
#include "refine/measure/gridline_bending.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/matched_filter.hpp"
#include "refine/refinement_step.hpp"
#include "refine/solve/subproblem.hpp"

namespace cmp::refine {

namespace {

using Numbers = View<const std::int64_t, 1>;

// The gridlines at the lost markers, then some of the others.
struct ReadGridlines {
  Array<std::int64_t, 1> numbers;  // (n,)
  Index count;                     // of the former
};

// Profiles across n gridlines.
struct WeighedProfiles {
  Array<double, 2> lines;          // (n, 8)
  Array<double, 2> sums;           // (n, 24), bending and dot gain eliminated
  ShiftGradients gradients;        // likewise
  Array<double, 1> weight;         // (n,) 0 to 1, similarity of gridlines to the pattern
  Array<double, 1> bend_variance;  // (n,) px^2
  Array<double, 2> bend_response;  // (n, 7), as update_without_bending gives it
};

// The items of a list with these numbers (n,).
template <class T>
Array<T, 1> selected_items(View<const T, 1> items, Numbers numbers) {
  Array<T, 1> out({numbers.size()});
  for (Index i = 0; i < numbers.size(); ++i) out[i] = items[numbers[i]];
  return out;
}

ReadGridlines lost_and_reference_gridlines(View<const bool, 1> lost, View<const std::int32_t, 2> edges,
                                           Index reference_interval) {
  Array<std::int64_t, 1> own = gridlines_at(lost, edges);
  const Index references = (edges.size() + reference_interval - 1) / reference_interval;
  Array<std::int64_t, 1> numbers({own.size() + references});
  std::copy(own.begin(), own.end(), numbers.begin());
  Index end = own.size();
  for (Index e = 0; e < edges.size(); e += reference_interval) {
    if (!lost[edges(e, 0)] && !lost[edges(e, 1)]) numbers[end++] = e;
  }
  return {numbers.first(end), own.size()};
}

// The weights (n,) of gridlines, of which those after the first `count` show the usual misfit.
Array<double, 1> profile_weights(View<const double, 2> sums, const ShiftGradients& gradients,
                                 View<const double, 2> clearance, Index count, const RecoveryLimits& limits) {
  const auto& weights = limits.profiles.step.weights;
  const auto& rule = limits.profiles.rule;
  const auto values = static_cast<double>(rule.values);
  const double tolerance = limits.profiles.misfit_tolerance;
  Array<double, 1> misfit =
      gridline_misfits(sums, gradients, values, static_cast<double>(rule.min_places), weights);
  const bool has_references = misfit.size() - count >= limits.min_reference_gridlines;
  const double median = median_of_misfits(misfit.from(has_references ? count : 0), weights);
  Array<double, 1> pardon({clearance.size()});
  for (Index e = 0; e < clearance.size(); ++e)
    pardon[e] = tolerance * tolerance * clearance(e, SQUARED_CONTRAST);
  return misfit_weights(sums, misfit, median, pardon, values, rule.default_weight, weights);
}

WeighedProfiles weighed_profiles(const image::PyramidLevel& view, const PatternState& state,
                                 const EdgeContrasts& contrasts, const layout::Topology& topology,
                                 const ReadGridlines& read, const RecoveryLimits& limits) {
  const Numbers numbers = read.numbers;
  const Array<std::int32_t, 2> ends = selected_rows(topology.edges, numbers);
  const Array<double, 2> bend = selected_rows(state.bend, numbers);
  const Array<double, 2> sides = selected_rows(contrasts.sides, numbers);
  const Array<double, 2> across = selected_rows(contrasts.contrasts, numbers);
  const Array<double, 2> clearance = selected_rows(contrasts.clearance, numbers);
  Array<double, 2> lines =
      gridlines(state.xy, state.maps, bend, ends, selected_rows(topology.edge_vectors, numbers),
                state.scatter.share, limits.gridlines);
  const Array<bool, 1> bending = bending_gridlines(state.roughness, bend, ends);
  Array<double, 2> sums = read_profiles(view, lines, {sides, across, clearance}, state.sigma, bending,
                                        limits.stations, limits.profiles.rows);
  ShiftGradients gradients = shift_gradients(sums);
  update_without_offsets(
      sums, gradients,
      dot_gain_offsets(sums, across, selected_rows(topology.edge_cells, numbers), state.dot_gain));
  const Array<double, 1> weight = selected_items(state.weight, numbers);
  const Array<double, 2> by_scatter = selected_rows(topology.scatter_bending, numbers);
  EliminatedBending bent =
      update_for_bending(sums, gradients, {bend, state.roughness, weight, state.scatter, by_scatter}, lines,
                         ends, state.noise, limits.profiles.rule, limits.profiles.step);
  Array<double, 1> profile_weight = profile_weights(sums, gradients, clearance, read.count, limits);
  return {std::move(lines),          std::move(sums),          std::move(gradients),
          std::move(profile_weight), std::move(bent.variance), std::move(bent.response)};
}

// (m,) 1/px^2, the information about the markers of the subproblem; those known and not hidden are held.
Array<double, 1> held_information(View<const bool, 1> hidden, View<const double, 2> xy, Numbers markers,
                                  const StepLimits& limits) {
  const Array<bool, 1> own = selected_items(hidden, markers);
  Array<double, 1> prior = prior_information(own, limits);
  for (Index k = 0; k < markers.size(); ++k) {
    if (!own[k] && std::isfinite(xy(markers[k], 0))) prior[k] = limits.information.held_information;
  }
  return prior;
}

// The markers (m, 2) px after their shifts.
Array<double, 2> shifted_markers(const GridlineSystem& system, const InformationArrays& information,
                                 View<const double, 1> gradient_start, View<const double, 1> gradient_end,
                                 Array<double, 2> xy, const InformationLimits& limits) {
  const Array<double, 2> right = gradient(system, gradient_start, gradient_end);
  const Array<double, 2> shift =
      solve_shifts(information.diagonal, information.off_diagonal, system.edges, right, right, limits);
  for (Index k = 0; k < xy.size(); ++k) {
    xy(k, 0) += shift(k, 0);
    xy(k, 1) += shift(k, 1);
  }
  return xy;
}

}  // namespace

void fill_recovered_markers(const image::PyramidLevel& view, const PatternState& state,
                            const EdgeContrasts& contrasts, const StartPlaces& places,
                            const layout::Topology& topology, const LostMarkers& markers,
                            const RecoveryLimits& limits) {
  const auto& step = limits.profiles.step;
  const ReadGridlines chosen =
      lost_and_reference_gridlines(markers.lost, topology.edges, limits.reference_interval);
  WeighedProfiles read = weighed_profiles(view, state, contrasts, topology, chosen, limits);
  const Index count = chosen.count;
  const Numbers numbers = chosen.numbers.view().slice(0, count);
  const auto weight = read.weight.slice(0, count);
  const SubproblemNumbering own = number_subproblem(numbers, topology.edges, topology.spokes);
  const Array<bool, 1> is_well_weighted = well_weighted_markers(weight, own.spokes, step.weights);
  Array<bool, 1> asked({own.markers.size()});
  for (Index k = 0; k < asked.size(); ++k) asked[k] = markers.lost[own.markers[k]] && is_well_weighted[k];
  if (std::find(asked.begin(), asked.end(), true) == asked.end()) return;
  const Array<double, 1> prior = held_information(state.hidden, markers.xy, own.markers, step);
  const Array<double, 2> across = selected_rows(contrasts.contrasts, numbers);
  const Array<double, 2> curved =
      curving(selected_rows(topology.end_couplings, numbers), state.scatter.share, read.bend_response);
  const GridlineSystem system{read.sums.slice(0, count),
                              weight,
                              read.lines.slice(0, count),
                              across,
                              curved,
                              own.ends,
                              own.spokes,
                              state.sigma,
                              state.noise * state.noise,
                              state.scatter.share};
  InformationArrays information = fisher_information(system, prior);
  const Array<double, 2> measured = shifted_markers(
      system, information, read.gradients.start.slice(0, count), read.gradients.end.slice(0, count),
      selected_rows(state.xy, own.markers.view()), step.information);
  const Array<double, 2> start = selected_rows(places.xy_px, own.markers.view());
  const Array<double, 1> edge = selected_items(places.edge_px, own.markers.view());
  const Array<bool, 1> agreed = selected_items(places.agreed, own.markers.view());
  const Array<bool, 1> is_intact = selected_items(places.is_intact, own.markers.view());
  const StartPlaces around{start, edge, agreed, is_intact};
  update_curving(information, system,
                 curving(selected_rows(topology.covariance_couplings, numbers), state.scatter.share,
                         read.bend_response));
  auto [xy, cov] = accepted_markers(measured, information, read.bend_variance.slice(0, count), own.ends,
                                    own.spokes, around, asked, limits.acceptance);
  update_obstructed_markers(xy, cov, asked, around, limits.hidden);
  for (Index k = 0; k < asked.size(); ++k) {
    if (!asked[k]) continue;
    copy<double, 1>(xy[k], markers.xy[own.markers[k]]);
    copy<double, 2>(cov[k], markers.cov[own.markers[k]]);
  }
}

}  // namespace cmp::refine
