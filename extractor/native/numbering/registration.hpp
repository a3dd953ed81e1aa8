// Registration of a connected part: of all turns and shifts of its lattice the one that the witnesses agree
// on.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// The weights of the witnesses; the Python module explains them.
struct WitnessLimits {
  double outside_weight, max_outside_share;
  std::int64_t min_outside;
  double trimmed_share;
  std::int64_t max_motions;

  template <class F>
  static WitnessLimits read(const F& f) {
    return {f["outside_weight"], f["max_outside_share"], f["min_outside"], f["trimmed_share"],
            f["max_motions"]};
  }
};

// The layouts of a family of pads as registration sees them: these differ in their white cells only.
struct RegisteredLayout {
  View<const std::int32_t, 2> axial;        // (U, 2) of the colored cells
  View<const std::int32_t, 2> white_axial;  // (W, 2) of the white down-cells of all pads
  View<const std::int32_t, 1> white_pad;    // (W,) the pad of each, in ascending order
  View<const std::int32_t, 2> cell_lookup;  // (S, S), as Lattice.cell_lookup

  CMP_FIELDS(axial, white_axial, white_pad, cell_lookup)
};

// The K best motions, the best first: (K, 3) turn, dq and dr; (K,) the pad; scores (K,), log odds; white
// (K,), the log odds of the white places alone; (K,) the number of the known ones of these; the best score of
// all motions but the first without the log odds of their white places; and the number of all motions.
using Motions = std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 1>, Array<double, 1>, Array<double, 1>,
                           Array<std::int32_t, 1>, double, Index>;

// Motions of a part's N cells: `turn` rotations by 120 degrees about marker 0, then a shift.
//
// axial (N, 2); naming (3,), the log odds that a class k of (q - r) mod 3 is the class k + t, for t = 0, 1,
// 2; white_axial (D, 2) and white (D,), the log odds that a down-cell is the white one over black; NaN is
// unknown.
Motions register_part(View<const std::int32_t, 2> axial, View<const double, 1> naming,
                      View<const std::int32_t, 2> white_axial, View<const double, 1> white,
                      const RegisteredLayout& layout, const WitnessLimits& limits);

// (D,) the number of cells (N, 2) that share a side with each down-cell (D, 2).
Array<std::int32_t, 1> cells_beside(View<const std::int32_t, 2> axial,
                                    View<const std::int32_t, 2> down_axial);

// (N,) the layout's cell of each cell (N, 2) after a motion, or -1.
Array<std::int32_t, 1> moved_cells(View<const std::int32_t, 2> axial, std::int32_t turn, std::int32_t dq,
                                   std::int32_t dr, View<const std::int32_t, 2> cell_lookup);

}  // namespace cmp::numbering
