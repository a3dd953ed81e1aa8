#include "track/image_check.hpp"

#include <cmath>
#include <limits>
#include <optional>

#include "numeric/bilinear.hpp"
#include "numeric/dense_systems.hpp"

namespace cmp::track {

namespace {

using numeric::dot3;

// An image as the samples take it.
struct SampledImage {
  View<const std::uint8_t, 1> flat;
  Index height, width;
};

// A predicted cell: its corners (3, 2), what lies across its edges (3,), its middle, and the radius of
// samples, px.
struct PredictedCell {
  View<const double, 2> xy;
  View<const std::uint8_t, 1> across_edge;
  double x, y, radius;
};

// The colors of a cell and around it.
struct CellColors {
  std::array<double, 3> middle, black;  // black: the sum over the edges to black cells
  std::array<double, 9> across;         // (3, 3) the color across each edge
  std::array<double, 3> own;            // the ink level over black
  Index black_count;

  View<double, 1> middle_view() { return {middle.data(), {3}}; }
  View<const double, 1> black_view() const { return {black.data(), {3}}; }
  View<double, 1> across_view(int k) { return {across.data() + 3 * k, {3}}; }
  View<const double, 1> own_view() const { return {own.data(), {3}}; }
};

// Edges across which the white cell is bright, is not bright, and a black cell is as bright as white.
struct WhiteEdges {
  std::int64_t white = 0, missing = 0, elsewhere = 0;
};

PredictedCell predicted_cell(View<const double, 2> xy, View<const std::uint8_t, 1> across_edge,
                             double level_radius) {
  const double x = (xy(0, 0) + xy(1, 0) + xy(2, 0)) / 3, y = (xy(0, 1) + xy(1, 1) + xy(2, 1)) / 3;
  return {xy, across_edge, x, y, level_radius * std::hypot(xy(0, 0) - x, xy(0, 1) - y)};
}

// Samples the colors across the cell's edges, and counts white ones.
//
// Returns whether no black cell is as bright as white; nothing if a sample lies outside the image.
std::optional<bool> sample_across_edges(const SampledImage& image, const PredictedCell& cell,
                                        double min_white_ratio, CellColors& colors, WhiteEdges& edges) {
  const double brightness = colors.middle[0] + colors.middle[1] + colors.middle[2];
  bool confirmed = true, outside = false;
  colors.black = {};
  colors.black_count = 0;
  for (int k = 0; k < 3; ++k) {
    if (cell.across_edge[k] == NO_CELL) continue;
    const int next = (k + 1) % 3;
    const double mx = cell.xy(k, 0) + cell.xy(next, 0) - cell.x,
                 my = cell.xy(k, 1) + cell.xy(next, 1) - cell.y;
    const auto color = colors.across_view(k);
    if (!numeric::fill_patch_mean(image.flat, image.height, image.width, mx, my, cell.radius, color)) {
      outside = true;
      continue;
    }
    const bool is_bright = color[0] + color[1] + color[2] > min_white_ratio * brightness;
    if (cell.across_edge[k] == WHITE_CELL) {
      edges.white += is_bright;
      edges.missing += !is_bright;
      continue;
    }
    edges.elsewhere += is_bright;
    confirmed = confirmed && !is_bright;
    for (int channel = 0; channel < 3; ++channel) colors.black[channel] += color[channel];
    ++colors.black_count;
  }
  if (outside || colors.black_count == 0) return std::nullopt;
  return confirmed;
}

// Whether the ink is as strong towards the corners as in the middle, and weak across edges to black cells.
bool has_ink_inside_only(const SampledImage& image, const PredictedCell& cell, CellColors& colors,
                         const CheckLimits& limits) {
  const auto own = colors.own_view();
  const double limit = limits.min_inner_strength * dot3(own, own);
  const double zero = dot3(own, colors.black_view()) / static_cast<double>(colors.black_count);
  const double position = limits.inner_sample_position;
  for (int k = 0; k < 3; ++k) {
    const double px = cell.x + position * (cell.xy(k, 0) - cell.x),
                 py = cell.y + position * (cell.xy(k, 1) - cell.y);
    const double inner =
        numeric::weighted_sample(image.flat, image.height, image.width, px, py, own[0], own[1], own[2]);
    if (!(inner - zero > limit)) return false;
    if (cell.across_edge[k] == BLACK_CELL && !(dot3(colors.across_view(k), own) - zero < limit)) return false;
  }
  return true;
}

// Whether the ink level over black resembles that of cell i in the previous frame, more than those of the
// other inks' cells.
bool is_same_ink(View<const double, 1> own, Index i, const WarmTables& tables, View<const double, 2> before,
                 const CheckLimits& limits) {
  const double strength = dot3(own, own), smallest = limits.smallest_square;
  const auto same = before[i];
  const double ratio = dot3(own, same) / std::max(dot3(same, same), smallest);
  if (!(ratio > limits.min_strength && ratio < limits.max_strength)) return false;
  int best = 0;
  double best_cosine = -1.0;
  for (int k = 0; k < 3; ++k) {
    const auto level = before[tables.nearest(i, k)];
    const double cosine = dot3(own, level) / std::sqrt(std::max(strength * dot3(level, level), smallest));
    if (cosine > best_cosine) {
      best = k + 1;
      best_cosine = cosine;
    }
  }
  return best == tables.ink[i] && best_cosine > limits.min_cosine;
}

}  // namespace

CellCheck check_cells(View<const std::uint8_t, 3> image, View<const double, 3> xy, const WarmTables& tables,
                      View<const double, 2> before, bool compare, const CheckLimits& limits) {
  const SampledImage sampled{image.flat(), image.size(0), image.size(1)};
  const Index count = xy.size();
  Array<std::uint8_t, 1> verdict({count}, UNSEEN);
  Array<double, 3> levels({2, count, 3}, std::numeric_limits<double>::quiet_NaN());
  CellColors colors{};
  WhiteEdges edges;
  for (Index i = 0; i < count; ++i) {
    const auto cell = predicted_cell(xy[i], tables.across_edge[i], limits.level_radius);
    if (!numeric::fill_patch_mean(sampled.flat, sampled.height, sampled.width, cell.x, cell.y, cell.radius,
                                  colors.middle_view()))
      continue;
    const auto no_rival = sample_across_edges(sampled, cell, limits.min_white_ratio, colors, edges);
    if (!no_rival) continue;
    for (int channel = 0; channel < 3; ++channel) {
      const double black = colors.black[channel] / static_cast<double>(colors.black_count);
      colors.own[channel] = colors.middle[channel] - black;
      levels(0, i, channel) = colors.own[channel];
      levels(1, i, channel) = black;
    }
    const bool is_confirmed = *no_rival && has_ink_inside_only(sampled, cell, colors, limits) &&
                              (!compare || is_same_ink(colors.own_view(), i, tables, before, limits));
    verdict[i] = is_confirmed ? CONFIRMED : CONTRADICTED;
  }
  return {std::move(verdict), std::move(levels), edges.white, edges.missing, edges.elsewhere};
}

}  // namespace cmp::track
