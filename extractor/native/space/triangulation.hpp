// The most likely points in space from their pictures in several views, with covariances.
#pragma once

#include <tuple>

#include "space/view.hpp"

namespace cmp::space {

inline constexpr int MAX_VIEWS = 8;

// Explained in extractor/space/triangulation.py.
struct TriangulationLimits {
  std::int64_t iterations;
  double converged, min_eigenvalue, min_ray_divergence, large_residual_px, min_damping, inflation_sigmas;

  template <class F>
  static TriangulationLimits read(const F& f) {
    return {f["iterations"],        f["converged"],   f["min_eigenvalue"],  f["min_ray_divergence"],
            f["large_residual_px"], f["min_damping"], f["inflation_sigmas"]};
  }
};

// What a caller accepts, see `triangulate` there.
struct Gate {
  double max_sigma_mm, sigmas, tolerance_px;

  template <class F>
  static Gate read(const F& f) {
    return {f["max_sigma_mm"], f["sigmas"], f["tolerance_px"]};
  }
};

// The views of a rig.
struct PlacedViews {
  int count;
  std::array<PlacedView, MAX_VIEWS> views;
};

// xyz_mm, cov_mm2, by_pose, misfit and reason of Points.
using Points = std::tuple<Array<double, 2>, Array<double, 3>, Array<double, 3>, Array<double, 1>,
                          Array<std::uint8_t, 1>>;

// Triangulates N points of V views.
//
// xy_px (V, N, 2), NaN where unseen; cov_px2 (V, N, 2, 2); cov_pose (6 V, 6 V), zero where the poses are
// exact.
Points triangulate(const PlacedViews& views, View<const double, 3> xy_px, View<const double, 4> cov_px2,
                   View<const double, 2> cov_pose, const Gate& gate, const TriangulationLimits& limits);

}  // namespace cmp::space
