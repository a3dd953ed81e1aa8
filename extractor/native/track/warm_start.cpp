#include "track/warm_start.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "numbering/marker_places.hpp"
#include "numeric/bilinear.hpp"
#include "track/image_check.hpp"

namespace cmp::track {

namespace {

// Whether the color (3,) of the middle of cell i matches its own ink better than the two others.
bool has_own_ink(const std::array<double, 3>& color, Index i, const WarmTables& tables,
                 View<const double, 2> levels, double min_strength) {
  const auto norm = [](View<const double, 1> v) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  };
  const double low = std::min(std::min(color[0], color[1]), color[2]);
  int best = 0;
  double best_score = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const auto ink = levels[tables.nearest(i, k)];
    const double score =
        (ink[0] * (color[0] - low) + ink[1] * (color[1] - low) + ink[2] * (color[2] - low)) / norm(ink);
    if (score > best_score) {
      best = k + 1;
      best_score = score;
    }
  }
  return best == tables.ink[i] && best_score > min_strength * norm(levels[i]);
}

}  // namespace

VisibleCells count_matching_centres(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                                    const WarmTables& tables, View<const double, 2> levels,
                                    const WarmStartLimits& limits) {
  const auto flat = image.flat();
  const Index height = image.size(0), width = image.size(1);
  std::array<double, 3> color{};
  const View<double, 1> color_view(color.data(), {3});
  std::int64_t visible = 0, matching = 0;
  for (Index i = 0; i < tables.corners.size(); ++i) {
    const auto corners = tables.corners[i];
    const auto a = xy[corners[0]], b = xy[corners[1]], c = xy[corners[2]];
    const double x = (a[0] + b[0] + c[0]) / 3, y = (a[1] + b[1] + c[1]) / 3;
    // outside the image, or NaN
    if (!numeric::fill_patch_mean(flat, height, width, x, y, limits.centre_radius_px, color_view)) continue;
    ++visible;
    matching += has_own_ink(color, i, tables, levels, limits.min_centre_strength);
  }
  return {visible, matching};
}

std::tuple<Array<bool, 1>, bool> connected_cells(View<const std::uint8_t, 1> verdict,
                                                 View<const bool, 1> first, View<const bool, 1> known,
                                                 View<const std::int32_t, 2> corners,
                                                 View<const std::int32_t, 2> cells_of_marker,
                                                 const WarmStartLimits& limits) {
  Array<bool, 1> reached({corners.size()});
  std::vector<Index> queue;
  queue.reserve(static_cast<std::size_t>(corners.size()));
  for (Index i = 0; i < corners.size(); ++i) {
    reached[i] = first[i] && verdict[i] == CONFIRMED;
    if (reached[i]) queue.push_back(i);
  }
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (const std::int32_t marker : corners[queue[head]]) {
      for (const std::int32_t j : cells_of_marker[marker]) {
        if (j < 0 || verdict[j] != CONFIRMED || reached[j]) continue;
        reached[j] = true;
        queue.push_back(j);
      }
    }
  }
  std::int64_t expected = 0, found = 0;
  for (Index i = 0; i < corners.size(); ++i) {
    if (verdict[i] == UNSEEN || !known[corners(i, 0)] || !known[corners(i, 1)] || !known[corners(i, 2)])
      continue;
    ++expected;
    found += reached[i];
  }
  const double least = limits.min_verified_share * static_cast<double>(expected);
  return {std::move(reached), !queue.empty() && static_cast<double>(found) >= least};
}

VerifiedMarkers verified_markers(View<const double, 2> xy, View<const bool, 1> proved,
                                 View<const std::int32_t, 2> corners) {
  const Index count = xy.size();
  Array<double, 2> kept({count, 2}, std::numeric_limits<double>::quiet_NaN());
  Array<std::int64_t, 1> verified_count({count}, 0), cell_count({count}, 0);
  for (Index i = 0; i < corners.size(); ++i) {
    for (const std::int32_t m : corners[i]) {
      cell_count[m] += 1;
      if (!proved[i]) continue;
      verified_count[m] += 1;
      copy<double, 1>(xy[m], kept[m]);
    }
  }
  Array<bool, 1> agreed({count}), is_intact({count});
  for (Index m = 0; m < count; ++m) {
    const numbering::CornerAgreement agreement(verified_count[m], cell_count[m]);
    agreed[m] = agreement.agreed;
    is_intact[m] = agreement.is_intact;
  }
  return {std::move(kept), std::move(agreed), std::move(is_intact)};
}

}  // namespace cmp::track
