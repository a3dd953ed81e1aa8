// The blocks of the rings around `RING_LANES` markers, which stand side by side, and the elimination of these
// rings.
#pragma once

#include <array>

#include "base/array.hpp"

namespace cmp::refine {

inline constexpr Index RING_LANES = 32;
inline constexpr Index RING = 6;             // neighbours of a marker at most
inline constexpr Index NEIGHBOUR_ROWS = 15;  // of every neighbour but the last
inline constexpr Index TAIL_ROWS = 10;
// First rows of a neighbour's blocks: its own as xx, xy, yy, then those (2, 2) that join it to the next
// neighbour, to the last one and to the middle.
inline constexpr Index OWN = 0, TO_NEXT = 3, TO_LAST = 7, TO_MIDDLE = 11;
// First rows in the tail: the last neighbour's own block, its block to the middle, and the middle's own
// block.
inline constexpr Index LAST = 0, LAST_TO_MIDDLE = 3, MIDDLE = 7;

struct RingLanes {
  using Row = std::array<double, RING_LANES>;
  // rows beyond those of five neighbours are written when the fifth is eliminated, and not read
  alignas(64) std::array<Row, RING * NEIGHBOUR_ROWS> rows;
  alignas(64) std::array<Row, TAIL_ROWS> tail;

  void clear() {
    for (Row& row : rows) row.fill(0.0);
    for (Row& row : tail) row.fill(0.0);
  }
};

// Eliminates all neighbours of all lanes; the middles' own blocks remain in the tail.
void update_without_ring(RingLanes& ring);

}  // namespace cmp::refine
