// Registration of a connected part: of all turns and shifts of its lattice the one that the witnesses agree
// on.
#pragma once

#include "base/array.hpp"
#include "numbering/ink_fields.hpp"

namespace cmp::numbering {

// The weights of the witnesses of a part's motion.
struct WitnessLimits {
  double outside_weight = 3.0;     // log odds against a motion for each cell outside the layout. Chosen.
  double max_outside_share = 0.1;  // of a part's cells outside the layout. Chosen.
  std::int64_t min_outside = 3;    // cells outside the layout that any part may have. Chosen.
  // of a part's cells at each end, without which it fits into the layout. Chosen.
  double trimmed_share = 0.03;
  std::int64_t max_motions = 100;  // the best ones, that are looked at. Chosen.
};

// The layouts of a family of pads as registration sees them: these differ in their white cells only.
struct RegisteredLayout {
  View<const std::int32_t, 2> axial;        // (U, 2) of the colored cells
  View<const std::int32_t, 2> white_axial;  // (W, 2) of the white down-cells of all pads
  View<const std::int32_t, 1> white_pad;    // (W,) the pad of each, in ascending order
  View<const std::int32_t, 2> cell_lookup;  // (S, S), as Lattice.cell_lookup

  CMP_FIELDS(axial, white_axial, white_pad, cell_lookup)
};

// The best motions of a part, the best first; the Python class explains them.
struct Motions {
  Array<std::int32_t, 2> motion;       // (K, 3)
  Array<std::int32_t, 1> pad;          // (K,)
  Array<double, 1> score, white;       // (K,)
  Array<std::int32_t, 1> known_white;  // (K,)
  double rival_without_white;
  Index compared;

  CMP_RECORD("extractor.numbering.registration.Motions", motion, pad, score, white, known_white,
             rival_without_white, compared)
};

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

// (N,) the layout's cell of each cell of a part after a motion (3,), or -1; -1 for cells of other parts.
Array<std::int32_t, 1> moved_cells(const WalkedCells& cells, std::int32_t part,
                                   View<const std::int32_t, 1> motion,
                                   View<const std::int32_t, 2> cell_lookup);

}  // namespace cmp::numbering
