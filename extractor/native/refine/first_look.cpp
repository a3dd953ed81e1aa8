#include "refine/first_look.hpp"

#include <cmath>

#include "refine/synthesis/gridline_sides.hpp"

namespace cmp::refine {

FirstAppearance initial_appearance(const image::PyramidLevel& view, const layout::Topology& topology,
                                   View<const double, 2> xy, double sigma, const FirstLookLimits& limits) {
  const auto image = view.image;
  const auto light = view.response.light;
  const auto& disc = limits.levels.disc;
  const View<const float, 3> no_model(nullptr, {0, 0, 3});
  // where all cells are clipped the estimate is NaN, and the first argument is returned
  const double noise =
      std::max(limits.weights.min_noise, image::estimate_noise(image, xy, topology.cells, limits.noise));
  const Array<double, 2> drawn = cell_means(image, light, no_model, xy, topology.cells, sigma, disc);
  const Array<double, 2> black = cell_means(image, light, no_model, xy, topology.black_cells, sigma, disc);
  const InkCells pattern{topology.cells, topology.black_cells, topology.cell_color};
  return {noise, smoothed_levels(drawn, black, xy, pattern, noise, view, limits.levels)};
}

ContrastArrays edge_contrasts(View<double, 2> lines, View<const double, 2> xy,
                              const layout::Topology& topology, const InkLevels& levels,
                              const image::PyramidLevel& view, const FirstLookLimits& limits) {
  const auto cells = topology.cells, edge_cells = topology.edge_cells;
  Array<double, 2> sides = GridlineSides(lines, xy, cells, edge_cells, view.frame).light(levels);
  Array<double, 2> contrasts = value_contrasts(sides, view.response.encoded);
  Array<double, 2> clearance = gridline_clearance(lines, contrasts, xy, cells, edge_cells, limits.profiles);
  return {std::move(sides), std::move(contrasts), std::move(clearance)};
}

BlurAndBleed blur_and_bleed(const image::PyramidLevel& view, View<const double, 2> lines,
                            const EdgeContrasts& across, View<const double, 2> xy,
                            View<const std::int32_t, 2> cells, double assumed,
                            const FirstLookLimits& limits) {
  const double found = profile_blur(view, lines, across, limits.blur_gridlines, limits.profiles);
  const double sigma =
      std::isfinite(found) ? std::max(found, limits.weights.min_sigma_px) : limits.fallback_sigma_px;
  auto [share, median_share] = bleed_shares(xy, cells, sigma, assumed, limits.bleed);
  return {sigma, std::move(share), median_share};
}

}  // namespace cmp::refine
