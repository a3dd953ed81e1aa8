#include "track/image_check.hpp"

#include <cmath>
#include <limits>
#include <optional>

#include "numeric/bilinear_batch.hpp"
#include "numeric/dense_systems.hpp"

namespace cmp::track {

namespace {

using numeric::dot3;

// An image as the samples take it.
struct SampledImage {
  View<const std::uint8_t, 1> flat;
  Index height, width;
};

constexpr Index CELL_PATCHES = 4;  // the middle of a cell, and across its edges

// A predicted cell: its corners (3, 2), what lies across its edges (3,), its middle, px, and the colors in
// its middle and across its edges (4, 4), as patch_means gives them.
struct PredictedCell {
  View<const double, 2> xy;
  View<const std::uint8_t, 1> across_edge;
  double x, y;
  View<const double, 2> colors;

  View<const double, 1> across(int k) const { return colors[1 + k]; }
};

// The colors of a cell and around it.
struct CellColors {
  std::array<double, 3> black;  // the sum over the edges to black cells
  std::array<double, 3> own;    // the ink level over black
  Index black_count;

  View<const double, 1> black_view() const { return {black.data(), {3}}; }
  View<const double, 1> own_view() const { return {own.data(), {3}}; }
};

// Edges across which the white cell is bright, is not bright, and a black cell is as bright as white.
struct WhiteEdges {
  std::int64_t white = 0, missing = 0, elsewhere = 0;
};

// The middles of the cells with the corners xy (C, 3, 2), and the places mirrored at their edges.
Array<numeric::Patch, 1> cell_patches(View<const double, 3> xy, double level_radius) {
  Array<numeric::Patch, 1> out({CELL_PATCHES * xy.size()});
  for (Index i = 0; i < xy.size(); ++i) {
    const auto own = xy[i];
    const double x = (own(0, 0) + own(1, 0) + own(2, 0)) / 3, y = (own(0, 1) + own(1, 1) + own(2, 1)) / 3;
    const double radius = level_radius * std::hypot(own(0, 0) - x, own(0, 1) - y);
    out[CELL_PATCHES * i] = {x, y, radius};
    for (Index k = 0; k < 3; ++k) {
      const Index next = (k + 1) % 3;
      out[CELL_PATCHES * i + 1 + k] = {own(k, 0) + own(next, 0) - x, own(k, 1) + own(next, 1) - y, radius};
    }
  }
  return out;
}

// Adds the colors across the cell's edges, and counts white ones.
//
// Returns whether no black cell is as bright as white; nothing if a place lies outside the image.
std::optional<bool> look_across_edges(const PredictedCell& cell, double min_white_ratio, CellColors& colors,
                                      WhiteEdges& edges) {
  const auto middle = cell.colors[0];
  const double brightness = middle[0] + middle[1] + middle[2];
  bool confirmed = true, outside = false;
  colors.black = {};
  colors.black_count = 0;
  for (int k = 0; k < 3; ++k) {
    if (cell.across_edge[k] == NO_CELL) continue;
    const auto color = cell.across(k);
    if (color[3] == 0.0) {
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
bool has_ink_inside_only(const SampledImage& image, const PredictedCell& cell, const CellColors& colors,
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
    if (cell.across_edge[k] == BLACK_CELL && !(dot3(cell.across(k), own) - zero < limit)) return false;
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
  const Array<numeric::Patch, 1> patches = cell_patches(xy, limits.level_radius);
  const Array<double, 2> means = numeric::patch_means(image, patches);
  CellColors colors{};
  WhiteEdges edges;
  for (Index i = 0; i < count; ++i) {
    const auto [x, y, _] = patches[CELL_PATCHES * i];
    const auto own = means.view().slice(CELL_PATCHES * i, CELL_PATCHES * (i + 1));
    const PredictedCell cell{xy[i], tables.across_edge[i], x, y, own};
    if (own(0, 3) == 0.0) continue;
    const auto no_rival = look_across_edges(cell, limits.min_white_ratio, colors, edges);
    if (!no_rival) continue;
    for (int channel = 0; channel < 3; ++channel) {
      const double black = colors.black[channel] / static_cast<double>(colors.black_count);
      colors.own[channel] = own(0, channel) - black;
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
