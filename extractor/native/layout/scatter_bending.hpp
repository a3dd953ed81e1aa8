// How independent scatter of the markers bends the gridlines at each of them.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

// (M, 3) over the variance of the scatter: the variance of a gridline's b by tangents, its covariance with
// the b by second derivatives, and the variance of the latter.
//
// The gridlines at a marker move it by the b that suits all of them best; the variance is that of gridlines
// which bend each by itself and move it as much. ids (E, K), markers with weights in a gridline's b; weights
// (2, E, K), by tangents and by second derivatives; normals (E, 2) unit vectors; spokes (M, 6), the gridlines
// at each marker, -1 for none.
Array<double, 2> scatter_bending(View<const std::int64_t, 2> ids, View<const double, 3> weights,
                                 View<const double, 2> normals, View<const std::int32_t, 2> spokes);

}  // namespace cmp::layout
