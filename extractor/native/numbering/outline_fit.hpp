// Finds the origin of the lattice by the pattern's outline where no white cell is visible: only if it is
// unique.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// Limits of an alignment; explained in extractor/numbering/outline_fit.py.
struct OutlineLimits {
  double min_seen_share, max_outside_share, min_margin_share;
  Index min_margin_cells, shift_margin, max_alignments, rim_width, batch_size;

  template <class F>
  static OutlineLimits read(const F& f) {
    return {f["min_seen_share"], f["max_outside_share"], f["min_margin_share"], f["min_margin_cells"],
            f["shift_margin"],   f["max_alignments"],    f["rim_width"],        f["batch_size"]};
  }
};

// Whether the alignment of connected cells with the layout is unique, and the layout's cells (N,) by it, or
// -1.
//
// axial (N, 2), axial coordinates of the connected cells, UNKNOWN_AXIAL for the others; layout_axial (U, 2)
// and cell_lookup (S, S) of the lattice.
std::tuple<bool, Array<std::int32_t, 1>> align(View<const std::int32_t, 2> axial,
                                               View<const std::int32_t, 2> layout_axial,
                                               View<const std::int32_t, 2> cell_lookup,
                                               const OutlineLimits& limits);

}  // namespace cmp::numbering
