#include "track/warm_start.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "numbering/marker_places.hpp"
#include "numeric/bilinear_batch.hpp"
#include "track/image_check.hpp"

namespace cmp::track {

namespace {

// Whether the color (3,) of the middle of cell i matches its own ink better than the two others.
bool has_own_ink(View<const double, 1> color, Index i, const WarmTables& tables,
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

// The cells of a layout whose middles lie in the image.
struct VisibleCells {
  std::int64_t visible, matching;  // the latter match their own ink better than the two others
};

// image (H, W, 3) BGR; xy (M, 2) markers, NaN where not predicted; levels (C, 3) ink levels over black.
VisibleCells count_matching_centres(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                                    const WarmTables& tables, View<const double, 2> levels,
                                    const WarmStartLimits& limits) {
  Array<numeric::Patch, 1> patches({tables.corners.size()});
  for (Index i = 0; i < patches.size(); ++i) {
    const auto [x, y] = cell_middle(xy, tables.corners[i]);
    patches[i] = {x, y, limits.centre_radius_px};
  }
  const Array<double, 2> colors = numeric::patch_means(image, patches);
  std::int64_t visible = 0, matching = 0;
  for (Index i = 0; i < colors.size(); ++i) {
    if (colors(i, 3) == 0.0) continue;  // outside the image, or NaN
    ++visible;
    matching += has_own_ink(colors[i], i, tables, levels, limits.min_centre_strength);
  }
  return {visible, matching};
}

// The cells (C,) that the image proves, and whether they are enough.
struct ProvedCells {
  Array<bool, 1> proved;
  bool is_enough;
};

// The confirmed cells that are connected to the first ones (C,) over common markers; they are enough if they
// are nearly all of the cells in view whose markers were known (M,).
ProvedCells connected_cells(View<const std::uint8_t, 1> verdict, View<const bool, 1> first,
                            View<const bool, 1> known, const WarmTables& tables,
                            const WarmStartLimits& limits) {
  const auto corners = tables.corners, cells_of_marker = tables.cells_of_marker;
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

// The corners of the proved cells (C,) in the full image; aligned, in the view.
numbering::InitialMarkers verified_markers(const image::PyramidLevel& view, const AlignedMarkers& aligned,
                                           View<const bool, 1> proved, View<const std::int32_t, 2> corners) {
  const auto scale = static_cast<double>(view.scale);
  const Index count = aligned.xy_px.size();
  Array<double, 2> kept({count, 2}, std::numeric_limits<double>::quiet_NaN());
  Array<std::int64_t, 1> verified_count({count}, 0), cell_count({count}, 0);
  for (Index i = 0; i < corners.size(); ++i) {
    for (const std::int32_t m : corners[i]) {
      cell_count[m] += 1;
      if (!proved[i]) continue;
      verified_count[m] += 1;
      for (Index axis = 0; axis < 2; ++axis) kept(m, axis) = (aligned.xy_px(m, axis) + 0.5) * scale - 0.5;
    }
  }
  Array<bool, 1> agreed({count}), is_intact({count});
  for (Index m = 0; m < count; ++m) {
    const numbering::CornerAgreement agreement(verified_count[m], cell_count[m]);
    agreed[m] = agreement.agreed;
    is_intact[m] = agreement.is_intact;
  }
  Array<double, 1> edge(aligned.edge_px.view());
  for (double& own : edge) own *= scale;
  return {std::move(kept), std::move(edge), std::move(agreed), std::move(is_intact)};
}

// The prediction, px in the view, under which most cells show their ink in their middle: the markers where
// they were, or moved as from the frame before; nothing with too few cells.
std::optional<Array<double, 2>> best_prediction(const image::PyramidLevel& view, const TrackState& state,
                                                const WarmTables& tables, const WarmStartLimits& limits) {
  std::vector<Array<double, 2>> candidates;
  candidates.push_back(view.to_level(state.xy_px));
  if (state.previous_px) {
    Array<double, 2> moving(state.xy_px);
    for (Index m = 0; m < moving.size(); ++m) {
      for (Index axis = 0; axis < 2; ++axis) {
        const double next = 2.0 * state.xy_px(m, axis) - (*state.previous_px)(m, axis);
        if (std::isfinite(next)) moving(m, axis) = next;
      }
    }
    candidates.push_back(view.to_level(moving));
  }
  std::optional<Array<double, 2>> best;
  double best_share = limits.min_predicted_share;
  for (auto& candidate : candidates) {
    const auto cells = count_matching_centres(view.image, candidate, tables, state.cells.levels[0], limits);
    const auto visible = static_cast<double>(cells.visible), matching = static_cast<double>(cells.matching);
    if (!(matching > best_share * visible)) continue;
    best = std::move(candidate), best_share = matching / visible;
    if (cells.matching == cells.visible) break;
  }
  return best;
}

// Markers moved to their cells' inks, and the centroids (C, 2) of these, px in the view.
struct FoundInks {
  AlignedMarkers aligned;
  Array<double, 2> centroid;
};

// The markers (M, 2) moved to the places of their cells' inks, in at most two passes.
//
// Blur, encoding and the choice of pixels shift centroids by a tenth of a pixel, equally in equal frames.
// Therefore a cell that rests has moved from the markers of the previous frame as its centroid has moved.
FoundInks align_to_inks(const image::PyramidLevel& view, Array<double, 2> predicted, const TrackState& state,
                        const WarmTables& tables, const WarmStartLimits& limits) {
  const auto& before = state.cells;
  const auto corners = tables.corners;
  const Array<double, 2> last = view.to_level(state.xy_px), last_ink = view.to_level(before.ink_px);
  FoundInks found{{std::move(predicted), 0.0, {}}, {}};
  for (int pass = 0; pass < 2; ++pass) {
    const Array<double, 2> at = std::move(found.aligned.xy_px);
    found.centroid = ink_centroids(view.image, at, tables, before.levels, limits.cells.alignment);
    Array<double, 2> shift(found.centroid.view());
    for (Index i = 0; i < shift.size(); ++i) {
      const auto middle = cell_middle(at, corners[i]), last_middle = cell_middle(last, corners[i]);
      const auto start = at[corners(i, 0)], end = at[corners(i, 1)];
      const double edge = limits.resting_shift * std::hypot(end[0] - start[0], end[1] - start[1]);
      for (Index axis = 0; axis < 2; ++axis) shift(i, axis) -= middle[axis];
      const double x = shift(i, 0) - (last_ink(i, 0) - last_middle[0]);
      const double y = shift(i, 1) - (last_ink(i, 1) - last_middle[1]);
      if (std::hypot(x, y) < edge) shift(i, 0) = x, shift(i, 1) = y;
    }
    found.aligned = update_shifts_and_move_markers(at, shift, corners, limits.cells.alignment);
    if (found.aligned.max_shift < limits.large_shift) break;
  }
  return found;
}

// The inks' levels in another light: before and now (2, 3), mean light of some cells over black, and of their
// black, in the previous and in the present image.
refine::LevelArrays levels_in_light(const refine::InkLevels& levels, View<const double, 2> before,
                                    View<const double, 2> now) {
  constexpr double TINY = 1e-9;  // keeps a division finite
  refine::LevelArrays out{Array<double, 2>(levels.cell), Array<double, 3>(levels.slope),
                          Array<double, 2>(levels.black), Array<bool, 1>(levels.is_outlier)};
  for (Index channel = 0; channel < 3; ++channel) {
    const double gain = now(0, channel) / std::max(before(0, channel), TINY);
    out.black(channel, 0) += now(1, channel) - before(1, channel);
    for (Index i = 0; i < out.cell.size(); ++i) {
      out.cell(i, channel) *= gain;
      for (Index axis = 0; axis < 2; ++axis) out.slope(i, channel, axis) *= gain;
    }
  }
  return out;
}

// Whether the white cell is where the layout has it, and nowhere else; where it is hidden, whether the whole
// rim is confirmed.
bool is_white_right(const CellCheck& check, View<const bool, 1> is_rim, const WarmStartLimits& limits) {
  if (check.white_elsewhere_count >= limits.min_white_edges) return false;
  if (check.white_count > 0)
    return check.white_count >= limits.min_white_edges && check.white_missing_count == 0;
  for (Index i = 0; i < is_rim.size(); ++i) {
    if (is_rim[i] && check.verdict[i] != CONFIRMED) return false;
  }
  return true;
}

}  // namespace

std::optional<WarmStart> warm_start(const image::PyramidLevel& view, const TrackState& state,
                                    const WarmTables& tables, const WarmStartLimits& limits) {
  const auto predicted = best_prediction(view, state, tables, limits);
  if (!predicted) return std::nullopt;
  const auto [aligned, centroid] =
      align_to_inks(view, predict_missing(tables, *predicted), state, tables, limits);
  const Array<double, 3> corners = corners_at(aligned.xy_px, tables.corners);
  CellCheck check = check_cells(view.image, corners, tables, state.cells.levels[0], true, limits.cells.check);
  if (!is_white_right(check, tables.is_rim, limits)) return std::nullopt;
  const bool by_rim = check.white_count == 0;
  const auto first = by_rim ? tables.is_rim : tables.is_at_white;
  const auto [proved, is_enough] = connected_cells(check.verdict, first, state.known, tables, limits);
  if (!is_enough) return std::nullopt;
  for (Index kind = 0; kind < 2; ++kind) {
    for (Index i = 0; i < proved.size(); ++i) {
      if (!proved[i]) copy<double, 1>(state.cells.levels[kind][i], check.cell_levels[kind][i]);
    }
  }
  Array<double, 2> light = mean_light(check.cell_levels, view.response.light);
  auto ink_levels = levels_in_light(state.appearance.levels, state.cells.light, light);
  return WarmStart{verified_markers(view, aligned, proved, tables.corners),
                   {std::move(check.cell_levels), std::move(light), view.to_full_scale(centroid)},
                   std::move(ink_levels),
                   by_rim};
}

}  // namespace cmp::track
