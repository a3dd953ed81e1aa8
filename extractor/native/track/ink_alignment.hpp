// The alignment of predicted cells to the image: every cell moves to the centroid of its ink nearby.
#pragma once

#include <array>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Limits of the alignment.
struct AlignmentLimits {
  double search_radius = 0.9;  // of the window around a cell's middle, in edges. Chosen.
  std::int64_t min_rows = 8;   // of pixels that are sampled in the window, at least. Chosen.
  double min_pixel_ink = 0.2;  // of an ink, for a pixel to count as this ink. Chosen.
  double min_ink_share = 0.4;  // of a cell's area that must show its ink in the window. Chosen.
  // of a cell from its prediction, in edges; beyond it the cell's shift is unknown. Chosen.
  double max_shift = 0.35;
  // of the shifts of cells that share a marker, from their mean, in edges; beyond it the marker is unknown.
  // Chosen.
  double max_spread = 0.25;
  // sine of the angle of an ink to the plane of the two others, for unmixing. Chosen.
  double min_volume = 0.05;
  // px^2, of the parallelogram of the window's unit axes; smaller cells have no shift. Chosen.
  double min_area_px = 1.0;
};

struct AlignedMarkers {
  Array<double, 2> xy_px;    // (M, 2), NaN where the shifts of the cells disagree or are unknown
  double max_shift;          // the largest shift, in edges
  Array<double, 1> edge_px;  // (M,) px, the mean edges of the cells at each marker
};

// The middle of a cell with these corners (3,); xy (M, 2) markers.
std::array<double, 2> cell_middle(View<const double, 2> xy, View<const std::int32_t, 1> corners);

// (C, 2) px, the centroid of each cell's ink near the cell's predicted middle, NaN where there is too little
// ink.
//
// The ink is unmixed from the two others, whose cells touch this cell's corners, and from white, which shows
// all three. The window is the ellipse that a disc in an equilateral cell becomes when the cell is sheared to
// its corners. image (H, W, 3) BGR; xy (M, 2) markers, NaN where not predicted; levels (2, C, 3) of
// CellCheck.
Array<double, 2> ink_centroids(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                               const WarmTables& tables, View<const double, 3> levels,
                               const AlignmentLimits& limits);

// The markers xy (M, 2) after the mean shift of their cells; too large shifts (C, 2) become NaN.
//
// corners (C, 3): the cells' markers.
AlignedMarkers update_shifts_and_move_markers(View<const double, 2> xy, View<double, 2> shift,
                                              View<const std::int32_t, 2> corners,
                                              const AlignmentLimits& limits);

}  // namespace cmp::track
