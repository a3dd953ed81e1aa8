// The warm start: a frame's numbering is predicted from the previous frame, and proved by the image.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Limits of the proof.
struct WarmStartLimits {
  double centre_radius_px = 0.5;  // of the disc over which a middle's color is averaged. Chosen.
  // of a middle's ink level, relative to the frame before, for the middle to show its ink. Chosen.
  double min_centre_strength = 0.3;
  double min_verified_share = 0.95;  // of the cells in view that the image must confirm. Chosen.
};

struct VerifiedMarkers {
  Array<double, 2> xy_px;            // (M, 2), NaN where no proved cell has a corner
  Array<bool, 1> agreed, is_intact;  // (M,) as in InitialMarkers

  CMP_RECORD("extractor.track.warm_start.VerifiedMarkers", xy_px, agreed, is_intact)
};

// The cells of a layout whose middles lie in the image.
struct VisibleCells {
  std::int64_t visible, matching;  // the latter match their own ink better than the two others

  CMP_RECORD("extractor.track.warm_start.VisibleCells", visible, matching)
};

// image (H, W, 3) BGR; xy (M, 2) markers, NaN where not predicted; levels (C, 3) ink levels over black.
VisibleCells count_matching_centres(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                                    const WarmTables& tables, View<const double, 2> levels,
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
