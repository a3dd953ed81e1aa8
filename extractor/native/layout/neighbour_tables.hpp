// The markers in the two rings around each marker.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

inline constexpr Index RING_MARKERS = 18;  // in two rings

// Limits of maps through neighbours; explained in extractor/layout/neighbour_tables.py.
struct NeighbourMapLimits {
  double min_spread;
  Index min_linear_neighbours, min_quadratic_neighbours;

  template <class F>
  static NeighbourMapLimits read(const F& f) {
    return {f["min_spread"], f["min_linear_neighbours"], f["min_quadratic_neighbours"]};
  }
};

// (M, 18) ids of the markers in the two rings around each marker at the axial (M, 2); -1 outside the pattern.
//
// steps (18, 2): the axial steps to them.
Array<std::int32_t, 2> neighbour_ids(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> steps,
                                     Index layers);

}  // namespace cmp::layout
