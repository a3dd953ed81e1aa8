// The numbering of the triangular lattice: axial (q, r) -> layer and id.
//
// Marker i of layer k has the id 3k(k-1) + 1 + i; index 0 lies at the axial (-k, k) and the index runs
// clockwise.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

inline constexpr int NEIGHBOURS = 6;
// (6, 2) axial steps from a marker to its neighbours; as in extractor/layout/lattice.py.
inline constexpr Index NEIGHBOUR_STEPS[NEIGHBOURS][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};

// A place of the lattice.
struct AxialPlace {
  Index q, r;
};

// The layer of the marker at the axial (q, r).
inline Index layer_of(Index q, Index r) {
  const Index sum = q + r;
  return std::max({q < 0 ? -q : q, r < 0 ? -r : r, sum < 0 ? -sum : sum});
}

// The id of the marker at the axial (q, r).
inline Index marker_id(Index q, Index r) {
  const Index k = layer_of(q, r);
  if (k == 0) return 0;
  Index i = 5 * k + r;
  if (r == k && q < 0) {
    i = q + k;
  } else if (q + r == k && q < k) {
    i = k + q;
  } else if (q == k && r > -k) {
    i = 2 * k - r;
  } else if ((r == -k && q > 0) || (q + r == -k && q > -k)) {
    i = 4 * k - q;
  }
  return 3 * k * (k - 1) + 1 + i;
}

// The axial place of a cell after a rotation of the lattice by `turn` (0, 1, 2) times 120 degrees.
//
// The rotation maps the three cells around the down-cell (turn, 0) to the cells around (0, 0). Inks are
// mapped onto themselves when the lattice is also shifted so that (q - r) mod 3 agrees.
inline AxialPlace rotated_cell(Index q, Index r, Index turn) {
  q -= turn;
  if (turn == 1) return {-q - r - 1, q + 1};
  if (turn == 2) return {r - 1, -q - r};
  return {q, r};
}

// (N, 2) the axial coordinates of cells (N, 2) after rotated_cell.
inline Array<std::int32_t, 2> rotated_cells(View<const std::int32_t, 2> axial, Index turn) {
  Array<std::int32_t, 2> out(axial.shape());
  for (Index i = 0; i < axial.size(); ++i) {
    const AxialPlace place = rotated_cell(axial(i, 0), axial(i, 1), turn);
    out(i, 0) = static_cast<std::int32_t>(place.q);
    out(i, 1) = static_cast<std::int32_t>(place.r);
  }
  return out;
}

}  // namespace cmp::layout
