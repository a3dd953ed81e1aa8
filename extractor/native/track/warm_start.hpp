// The warm start: a frame's numbering is predicted from the previous frame, and proved by the image.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// The limits of the native part; the Python module explains them.
struct WarmStartLimits {
  double center_radius_px;
  double min_center_strength;
  double min_verified_share;

  template <class F>
  static WarmStartLimits read(const F& f) {
    return {f["center_radius_px"], f["min_center_strength"], f["min_verified_share"]};
  }
};

// The markers (M, 2), NaN where no proved cell has a corner; agreed (M,) and is_intact (M,) of
// InitialMarkers.
using VerifiedMarkers = std::tuple<Array<double, 2>, Array<bool, 1>, Array<bool, 1>>;

// Number of cells in view, and of those whose middle matches their own ink better than the two others.
//
// image (H, W, 3) BGR; xy (M, 2) markers, NaN where not predicted; levels (C, 3) ink levels over black.
std::tuple<std::int64_t, std::int64_t> count_matching_centers(View<const std::uint8_t, 3> image,
                                                              View<const double, 2> xy,
                                                              const WarmTables& tables,
                                                              View<const double, 2> levels,
                                                              const WarmStartLimits& limits);

// (C,) the confirmed cells that are connected to the first ones (C,) over common markers; and whether they
// are nearly all of the cells in view whose markers were known (M,).
//
// verdict (C,), corners (C, 3), cells_of_marker (M, 3) as in CellCheck and WarmTables.
std::tuple<Array<bool, 1>, bool> connected_cells(View<const std::uint8_t, 1> verdict,
                                                 View<const bool, 1> first, View<const bool, 1> known,
                                                 View<const std::int32_t, 2> corners,
                                                 View<const std::int32_t, 2> cells_of_marker,
                                                 const WarmStartLimits& limits);

// The corners of the cells proved (C,); xy (M, 2), corners (C, 3).
VerifiedMarkers verified_markers(View<const double, 2> xy, View<const bool, 1> proved,
                                 View<const std::int32_t, 2> corners);

}  // namespace cmp::track
