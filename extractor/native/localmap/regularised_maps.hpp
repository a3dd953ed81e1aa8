// Quadratic maps through the markers of two rings, with regularised curvature, for many markers at once.
//
// The maps are used where markers of the rings are unknown, as around damage. An unknown neighbour
// has no weight.
#pragma once

#include "base/array.hpp"

namespace cmp::localmap {

// Limits of regularised maps.
struct RegularisedMapLimits {
  double min_sine2 = 0.05;   // least squared sine of the angle between the neighbours' directions. Chosen.
  Index min_neighbours = 2;  // known markers; fewer do not determine the slopes. Derived: two slopes.
  Index min_curved_neighbours = 5;  // known markers; with fewer the map is linear. Derived: five derivatives.
  // known markers; with fewer the curvature is held by weak_ridge. Chosen.
  Index min_firm_neighbours = 8;
  // added to the diagonal of the curvature's normal equations with enough neighbours, with some, and with too
  // few; the unit is that of the layout's vectors. Chosen; the last one is so large that nothing curves.
  double firm_ridge = 0.001, weak_ridge = 0.02, linear_ridge = 1e9;

  template <class F>
  static RegularisedMapLimits read(const F& f) {
    return {f["min_sine2"],  f["min_neighbours"], f["min_curved_neighbours"], f["min_firm_neighbours"],
            f["firm_ridge"], f["weak_ridge"],     f["linear_ridge"]};
  }
};

// Writes the derivatives x, y, xx, xy, yy of the image coordinates where the neighbours determine them.
//
// xy (M, 2) px, the markers' places, NaN unknown; markers (n,) to evaluate; ring_markers (M, K) their
// neighbours, or -1; ring_vectors (M, K, 2) the vectors to them in the layout; out (M, 2, 5) receives the
// derivatives of x and y.
void fill_quadratic_derivatives(View<const double, 2> xy, View<const std::int64_t, 1> markers,
                                View<const std::int32_t, 2> ring_markers, View<const double, 3> ring_vectors,
                                View<double, 3> out, const RegularisedMapLimits& limits);

}  // namespace cmp::localmap
