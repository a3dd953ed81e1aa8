#include "refine/drawn_pattern.hpp"

#include "refine/measure/gridline_bending.hpp"
#include "refine/measure/ink_shift.hpp"
#include "refine/synthesis/gridline_sides.hpp"
#include "refine/synthesis/pattern_drawing.hpp"

namespace cmp::refine {

namespace {

// What a drawing shows: the image, its pattern, and the picture that is drawn.
struct DrawingInput {
  const image::PyramidLevel& view;
  const layout::Topology& topology;
  View<const float, 3> picture;
  const PatternState& state;
};

// The levels corrected by the residual in the middle of the cells.
LevelArrays corrected_levels(const DrawingInput& input, const InkLevels& levels,
                             const InkLevelLimits& limits) {
  const auto& view = input.view;
  const auto& topology = input.topology;
  const auto xy = input.state.xy;
  const auto light = view.response.light;
  const auto means = [&](View<const std::int32_t, 2> cells) {
    return cell_means(view.image, light, input.picture, xy, cells, 0.0, limits.disc);
  };
  Array<double, 2> own = means(topology.cells);
  for (Index i = 0; i < own.size(); ++i) {
    for (Index channel = 0; channel < 3; ++channel) own(i, channel) += levels.cell(i, channel);
  }
  const InkCells cells{topology.cells, topology.black_cells, topology.cell_color};
  return smoothed_levels(own, means(topology.black_cells), xy, cells, input.state.noise, view, limits);
}

// The change of levels since `before`, in units of `unit`.
template <int N>
Array<double, N> change(View<const double, N> now, View<const double, N> before, double unit) {
  Array<double, N> out(now);
  const auto own = out.flat();
  const auto other = before.flat();
  for (Index k = 0; k < own.size(); ++k) own[k] = (own[k] - other[k]) / unit;
  return out;
}

}  // namespace

DrawnPattern draw_pattern(const image::PyramidLevel& view, const layout::Topology& topology,
                          View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                          View<const std::int64_t, 1> box, Index stations, const DrawingLimits& limits) {
  const auto xy = state.xy;
  const auto cells = topology.cells, edges = topology.edges, edge_cells = topology.edge_cells;
  const double sigma = state.sigma;
  Array<double, 2> lines = gridlines(xy, state.maps, state.bend, edges, topology.edge_vectors,
                                     state.scatter.share, limits.gridlines);
  update_with_offsets(lines, ink_offsets(state.ink_shift, lines, state.maps, topology));
  const GridlineSides beside(lines, xy, cells, edge_cells, view.frame);
  Array<double, 2> sides = beside.light(levels);
  draw_cells({xy, cells, topology.cell_edges, edges, lines}, {levels.cell, levels.slope, sigma}, box,
             picture);
  LevelArrays corrected = corrected_levels({view, topology, picture, state}, levels, limits.levels);
  // the drawing lacks the black, and the change of the levels since
  const auto& [cell, slope, black, is_outlier] = corrected;
  Array<double, 2> added = beside.light(
      {change<2>(cell, levels.cell, 1.0), change<3>(slope, levels.slope, 1.0), black, is_outlier});
  const double step = limits.blur_step;
  const auto [wider_cell, wider_slope, wider_black, _] =
      levels_at_blur(levels, xy, cells, topology.cell_color, sigma, (1.0 + step) * sigma, limits.bleed);
  const Array<double, 2> bleed =
      beside.light({change<2>(wider_cell, levels.cell, step), change<3>(wider_slope, levels.slope, step),
                    change<2>(wider_black, levels.black, step), levels.is_outlier});
  const Array<bool, 1> bending = bending_gridlines(state.roughness, state.bend, edges);
  ResidualSums sums = accumulate_residual_sums(view, picture, {lines, sides, added, bleed, bending}, sigma,
                                               box, stations, limits.rows);
  Array<double, 2> contrasts = value_contrasts(sides, view.response.encoded);
  const double edge_px = median_edge(xy, edges, limits.weights);
  return {std::move(lines),     std::move(sides), std::move(contrasts), std::move(added), std::move(sums),
          std::move(corrected), edge_px};
}

}  // namespace cmp::refine
