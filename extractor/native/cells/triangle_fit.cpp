#include "cells/triangle_fit.hpp"

namespace cmp::cells {

FittedTriangles fit_to_moments(View<const double, 2> moments, View<const std::int32_t, 2> seed,
                               const ShapeLimits& limits) {
  const Index count = moments.size();
  Array<double, 3> corners({count, 3, 2}, 0.0);
  Array<double, 1> quality({count}, -1.0);
  for (Index i = 0; i < count; ++i) {
    if (!(moments(i, 0) > 0.0)) continue;
    MomentSums sums;
    for (int k = 0; k < MOMENT_TERMS; ++k) sums.of[k] = moments(i, k);
    const MomentShape shape = shape_of(sums);
    quality[i] = limits.quality(shape);
    if (quality[i] <= 0.0) continue;
    fill_corners(shape, corners[i]);
    for (int k = 0; k < 3; ++k)
      for (int axis = 0; axis < 2; ++axis) corners(i, k, axis) += seed(i, axis);
  }
  return {std::move(corners), std::move(quality)};
}

}  // namespace cmp::cells
