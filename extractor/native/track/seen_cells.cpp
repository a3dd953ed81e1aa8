#include "track/seen_cells.hpp"

#include <cmath>

namespace cmp::track {

namespace {

// The light of a value that need not be whole.
double decoded(double value, View<const float, 1> light) {
  const double inside = std::min(std::max(value, 0.0), 255.0);
  const auto below = static_cast<Index>(std::min(inside, 254.0));
  const double least = light[below];
  return least + (inside - static_cast<double>(below)) * (static_cast<double>(light[below + 1]) - least);
}

// Gives the cells of an ink that are not seen, NaN in levels (2, C, 3), the mean levels of the others; 0
// without any.
void fill_unseen(View<double, 3> levels, View<const std::uint8_t, 1> ink, std::uint8_t own) {
  for (Index kind = 0; kind < 2; ++kind) {
    for (Index channel = 0; channel < 3; ++channel) {
      double sum = 0.0, count = 0.0;
      for (Index i = 0; i < ink.size(); ++i) {
        const double level = levels(kind, i, channel);
        if (ink[i] == own && !std::isnan(level)) sum += level, count += 1.0;
      }
      for (Index i = 0; i < ink.size(); ++i) {
        double& level = levels(kind, i, channel);
        if (ink[i] == own && std::isnan(level)) level = count > 0.0 ? sum / count : 0.0;
      }
    }
  }
}

}  // namespace

Array<double, 2> mean_light(View<const double, 3> levels, View<const float, 1> light) {
  Array<double, 2> out({2, 3}, 0.0);
  const Index count = levels.size(1);
  for (Index i = 0; i < count; ++i) {
    for (Index channel = 0; channel < 3; ++channel) {
      const double black = decoded(levels(1, i, channel), light);
      out(0, channel) += decoded(levels(0, i, channel) + levels(1, i, channel), light) - black;
      out(1, channel) += black;
    }
  }
  for (double& value : out) value /= std::max(static_cast<double>(count), 1.0);
  return out;
}

SeenCellsArrays seen_cells(const image::PyramidLevel& view, View<const double, 2> xy_px,
                           const WarmTables& tables, const CellLimits& limits) {
  const Array<double, 2> none({tables.corners.size(), 3}, 0.0);
  const Array<double, 2> xy = view.to_level(xy_px);
  const Array<double, 3> corners = corners_at(xy, tables.corners);
  auto levels = check_cells(view.image, corners, tables, none, false, limits.check).cell_levels;
  for (const std::uint8_t ink : {1, 2, 3}) fill_unseen(levels, tables.ink, ink);
  const Array<double, 2> ink = ink_centroids(view.image, xy, tables, levels, limits.alignment);
  Array<double, 2> light = mean_light(levels, view.response.light);
  return {std::move(levels), std::move(light), view.to_full_scale(ink)};
}

}  // namespace cmp::track
