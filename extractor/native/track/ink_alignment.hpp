// The alignment of predicted cells to the image: every cell moves to the centroid of its ink nearby.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// The limits of the alignment; the Python module explains them.
struct AlignmentLimits {
  double search_radius;
  std::int64_t min_rows;
  double min_pixel_ink;
  double min_ink_share;
  double max_shift;
  double max_spread;
  double min_volume;
  double min_area_px;

  template <class F>
  static AlignmentLimits read(const F& f) {
    return {f["search_radius"], f["min_rows"],   f["min_pixel_ink"], f["min_ink_share"],
            f["max_shift"],     f["max_spread"], f["min_volume"],    f["min_area_px"]};
  }
};

// The markers (M, 2), NaN where the shifts of the cells disagree or are unknown; the largest shift, in edges;
// the mean edges (M,) of the cells at each marker, px.
using AlignedMarkers = std::tuple<Array<double, 2>, double, Array<double, 1>>;

// (C, 2) px from each cell's predicted middle to the centroid of its ink nearby, NaN where there is too
// little ink.
//
// The ink is unmixed from the two others, whose cells touch this cell's corners, and from white, which shows
// all three. The window is the ellipse that a disc in an equilateral cell becomes when the cell is sheared to
// its corners. image (H, W, 3) BGR; xy (M, 2) markers, NaN where not predicted; levels (2, C, 3) of
// CellCheck.
Array<double, 2> measure_shifts(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                                const WarmTables& tables, View<const double, 3> levels,
                                const AlignmentLimits& limits);

// The markers xy (M, 2) after the mean shift of their cells; too large shifts (C, 2) become NaN.
//
// corners (C, 3): the cells' markers.
AlignedMarkers update_shifts_and_move_markers(View<const double, 2> xy, View<double, 2> shift,
                                              View<const std::int32_t, 2> corners,
                                              const AlignmentLimits& limits);

}  // namespace cmp::track
