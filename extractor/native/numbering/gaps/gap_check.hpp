// Checks whether detached numbered cells lie where the pattern continues.
//
// The numbered cells are divided into blocks connected by shared corners. Beginning with the block at the
// white cell, the nearest blocks first, each block is compared with the consistent cells: the vectors between
// their centers must have the lengths that the pattern's slopes on both sides predict. A slope is the local
// linear map from layout to image.
#pragma once

#include "base/array.hpp"
#include "numbering/gaps/corner_contact.hpp"

namespace cmp::numbering {

// Limits of the check; explained in extractor/numbering/gaps/gap_check.py.
struct GapCheckLimits {
  double max_median_jump, max_jump_share, max_single_jump, max_gap, max_gap_ratio, min_slope_spread;
  double max_contact_jump;
  Index reference_candidates, white_cell_neighbours, min_white_cell_neighbours;
  double max_white_cell_misfit;
  Index min_block_cells;
  double min_block_share;
  CornerContactLimits contact;

  template <class F>
  static GapCheckLimits read(const F& f) {
    return {f["max_median_jump"],       f["max_jump_share"],
            f["max_single_jump"],       f["max_gap"],
            f["max_gap_ratio"],         f["min_slope_spread"],
            f["max_contact_jump"],      f["reference_candidates"],
            f["white_cell_neighbours"], f["min_white_cell_neighbours"],
            f["max_white_cell_misfit"], f["min_block_cells"],
            f["min_block_share"],       f["contact"]};
  }
};

// (N,), the numbered cells consistent with the reference block.
//
// cell (N,), the layout's cell of each cell of the image, or -1; white_px (2,), the center of the white cell,
// NaN if the outline gave the origin; neighbours (N, 6), by corner_neighbours.
Array<bool, 1> consistent_cells(const Contacts& contacts, View<const std::int32_t, 1> cell,
                                View<const double, 1> white_px, View<const std::int32_t, 2> neighbours,
                                const GapCheckLimits& limits);

// Whether the numbered cells nearest to the white cell predict it elsewhere, by the local slopes.
//
// A part of the pattern that does not touch the white cell may be numbered one step aside. The cells around
// the white cell were then numbered by that part, and contradict it. False where no such cell is within
// reach. center (N, 2) px and is_intact (N,), as in CellArrays; cell (N,), the layout's cell of each cell of
// the image, or -1; white_px and white_mm (2,), the white cell's center in the image and in the layout.
bool is_white_cell_contradicted(View<const double, 2> center, View<const bool, 1> is_intact,
                                View<const std::int32_t, 1> cell, View<const double, 1> white_px,
                                View<const double, 1> white_mm, const layout::LayoutCells& layout,
                                const GapCheckLimits& limits);

}  // namespace cmp::numbering
