// Stage 5: fits triangles to the moments of regions.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "cells/moments.hpp"

namespace cmp::cells {

// Corners (N, 3, 2), clockwise with y down; qualities (N,), at most 1, negative for regions that are no
// triangles.
using FittedTriangles = std::tuple<Array<double, 3>, Array<double, 1>>;

// moments (N, 10) of regions about their seeds (N, 2).
FittedTriangles fit_to_moments(View<const double, 2> moments, View<const std::int32_t, 2> seed,
                               const ShapeLimits& limits);

}  // namespace cmp::cells
