// The place of a part of a coded pad: of all turns and shifts, the ones whose white cells agree best.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// The code of a layout: bit q of row r is the down-cell (q - origin, r - origin).
struct CodeBoard {
  View<const std::uint64_t, 1> white, cells;
  std::int64_t origin;

  template <class F>
  static CodeBoard read(const F& f) {
    return {f["white"], f["cells"], f["origin"]};
  }
};

// The best motions, the best first: (K, 3) turns by 120 degrees about marker 0, and shifts of q and r; wrong
// (K,), how many known cells differ from the layout, outside of which all is black.
using CodeMotions = std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 1>>;

// Motions of D down-cells: those that carry `least_inside` of them into the layout.
//
// axial (D, 2); bit (D,): 1 white, 0 black, -1 unknown. are_inks_known: only motions that keep the inks.
CodeMotions code_motions(View<const std::int32_t, 2> axial, View<const std::int8_t, 1> bit,
                         const CodeBoard& board, std::int64_t least_inside, bool are_inks_known,
                         std::int64_t most);

}  // namespace cmp::numbering
