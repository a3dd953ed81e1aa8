// The markers in the two rings around each marker.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

inline constexpr Index RING_MARKERS = 18;  // in two rings

// Limits of maps through the markers around a marker.
struct NeighbourMapLimits {
  // least ratio of the neighbours' spread across to along; below it they lie on one line. Chosen.
  double min_spread = 1e-3;
  // fewer markers give no map. Derived: three coefficients, and one equation over.
  Index min_linear_neighbours = 4;
  // fewer markers give the linear map. Derived: six coefficients, and three equations over.
  Index min_quadratic_neighbours = 9;
};

// (M, 18) ids of the markers in the two rings around each marker at the axial (M, 2); -1 outside the pattern.
//
// steps (18, 2): the axial steps to them.
Array<std::int32_t, 2> neighbour_ids(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> steps,
                                     Index layers);

}  // namespace cmp::layout
