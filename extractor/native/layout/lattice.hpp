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

}  // namespace cmp::layout
