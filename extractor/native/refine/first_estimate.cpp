#include "refine/first_estimate.hpp"

#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

namespace {

// The appearance of the image, as far as it is known.
struct Look {
  double sigma, noise, pixel_noise;
  LevelArrays levels;
};

Look known_look(const KnownAppearance& known) {
  const auto& [cell, slope, black, is_outlier] = known.levels;
  return {
      known.sigma,
      known.noise,
      known.pixel_noise,
      {Array<double, 2>(cell), Array<double, 3>(slope), Array<double, 2>(black), Array<bool, 1>(is_outlier)}};
}

// The noise and the levels; the blur is not known yet.
Look first_look(const image::PyramidLevel& view, const layout::Topology& topology, View<const double, 2> xy,
                double assumed, const FirstLookLimits& limits) {
  auto [noise, levels] = initial_appearance(view, topology, xy, assumed, limits);
  return {0.0, noise, noise, std::move(levels)};
}

EdgeContrasts contrasts_of(const ContrastArrays& arrays) {
  return {arrays.sides, arrays.contrasts, arrays.clearance};
}

// The places with outliers put where their neighbours predict them.
numbering::InitialMarkers corrected_places(const StartPlaces& places, CorrectedOutliers& after) {
  if (after.found)
    return {std::move(after.xy_px), Array<double, 1>(places.edge_px), std::move(after.agreed),
            std::move(after.is_intact)};
  return {Array<double, 2>(places.xy_px), Array<double, 1>(places.edge_px), Array<bool, 1>(places.agreed),
          Array<bool, 1>(places.is_intact)};
}

}  // namespace

FirstEstimateArrays::operator FirstEstimate() const {
  return {measured,
          reliable,
          bend,
          information,
          weight,
          sigma,
          noise,
          pixel_noise,
          dot_gain,
          ink_shift,
          levels_of(levels),
          contrasts_of(contrasts),
          {places.xy_px, places.edge_px, places.agreed, places.is_intact}};
}

FirstEstimateArrays first_estimate(const image::PyramidLevel& view, const layout::Topology& topology,
                                   View<const double, 2> start, const StartPlaces& places,
                                   const std::optional<KnownAppearance>& known, Index rows,
                                   const FirstEstimateLimits& limits) {
  const auto edges = topology.edges;
  const auto scale = static_cast<double>(view.scale);
  const double assumed = limits.default_sigma_px / scale;
  const auto& profiles = limits.profiles;
  const auto [xy, hidden, maps] =
      extrapolate_pattern(view.to_level(start), topology, profiles.step.gridlines);
  auto [sigma, noise, pixel_noise, levels] =
      known ? known_look(*known) : first_look(view, topology, xy, assumed, limits.look);
  const Array<double, 2> straight({edges.size(), 2}, 0.0);
  Array<double, 2> lines =
      gridlines(xy, maps, straight, edges, topology.edge_vectors, 0.0, profiles.step.gridlines);
  ContrastArrays contrasts = edge_contrasts(lines, xy, topology, levels_of(levels), view, limits.look);
  if (!known) {
    const auto [found, share, median_share] =
        blur_and_bleed(view, lines, contrasts_of(contrasts), xy, topology.cells, assumed, limits.look);
    sigma = found;
    if (median_share > limits.min_corrected_bleed) {
      levels = remove_bleed(levels_of(levels), topology.cell_color, share, median_share, limits.look.bleed);
      contrasts = edge_contrasts(lines, xy, topology, levels_of(levels), view, limits.look);
    }
  }
  const Array<double, 1> smooth({xy.size()}, 0.0), alike({edges.size()}, 1.0);
  const Array<double, 2> registered({SHIFTED_INKS, 2}, 0.0);
  const PatternState state{xy,    hidden, maps, smooth,     straight,  alike,
                           sigma, noise,  0.0,  registered, {0.0, 0.0}};
  auto [profile_weight, weight, dot_gain, ink_shift, solution] =
      profile_step(view, lines, contrasts_of(contrasts), state, topology, rows, profiles);
  CorrectedOutliers after =
      correct_outliers(topology, {solution.measured, solution.reliable, hidden, maps, weight}, places,
                       profile_weight, scale, limits.outliers);
  numbering::InitialMarkers corrected = corrected_places(places, after);
  return {std::move(after.found ? after.measured : solution.measured),
          std::move(after.found ? after.reliable : solution.reliable),
          std::move(solution.bend),
          std::move(solution.information),
          std::move(weight),
          sigma,
          noise,
          pixel_noise,
          dot_gain,
          std::move(ink_shift),
          std::move(levels),
          std::move(contrasts),
          std::move(corrected)};
}

}  // namespace cmp::refine
