// Numbers detached cells, behind a scratch or amid missing cells, by contact or by prediction and color.
#pragma once

#include "base/array.hpp"
#include "numbering/gaps/cell_claims.hpp"
#include "numbering/gaps/corner_contact.hpp"
#include "numbering/gaps/gap_check.hpp"

namespace cmp::numbering {

// Limits of the numbering; explained in extractor/numbering/gaps/detached_cells.py.
struct DetachedLimits {
  Index max_rounds, min_numbered_cells;
  CellClaimLimits claims;
  GapCheckLimits check;

  template <class F>
  static DetachedLimits read(const F& f) {
    return {f["max_rounds"], f["min_numbered_cells"], f["claims"], f["check"]};
  }
};

// (N,), cell with the numbers of detached cells added and inconsistent numbers removed.
//
// cell (N,), the layout's cell of each cell of the image, or -1; white_px (2,), the center of the white cell,
// NaN if the outline gave the origin; corner_step, the corners from one to the next of the layout's cell,
// clockwise in the image: 1 from the back, 2 from the front.
Array<std::int32_t, 1> number_detached(const cells::CellArrays& cells, View<const std::int32_t, 1> cell,
                                       View<const double, 1> white_px, const layout::LayoutCells& layout,
                                       Index corner_step, const DetachedLimits& limits);

}  // namespace cmp::numbering
