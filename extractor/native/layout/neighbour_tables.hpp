// The markers in the two rings around each marker.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

// As in extractor/layout/neighbour_tables.py:
inline constexpr Index QUADRATIC_TERMS =
    6;  // of a quadratic map: 1, x, y, x^2, xy, y^2 in units of the local edge
inline constexpr Index RIGHT_SIDES = 3;    // of its normal equations: x, y and the leverage
inline constexpr Index LINEAR_TERMS = 3;   // of a linear map: 1, x, y
inline constexpr Index RING_MARKERS = 18;  // in two rings

// Limits of maps through neighbours; explained in extractor/layout/neighbour_tables.py.
struct NeighbourMapLimits {
  double min_pivot;
  Index min_linear_neighbours, min_quadratic_neighbours;

  template <class F>
  static NeighbourMapLimits read(const F& f) {
    return {f["min_pivot"], f["min_linear_neighbours"], f["min_quadratic_neighbours"]};
  }
};

// (M, 18) ids of the markers in the two rings around each marker at the axial (M, 2); -1 outside the pattern.
//
// steps (18, 2): the axial steps to them.
Array<std::int32_t, 2> neighbour_ids(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> steps,
                                     Index layers);

}  // namespace cmp::layout
