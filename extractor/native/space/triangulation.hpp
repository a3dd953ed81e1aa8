// The most likely points in space from their pictures in several views, with covariances.
#pragma once

#include "space/view.hpp"

namespace cmp::space {

inline constexpr int MAX_VIEWS = 8;

struct TriangulationLimits {
  std::int64_t iterations = 12;  // most steps of a point. Chosen.
  double converged = 1e-5;       // last step, in standard deviations. Chosen.
  // of an information matrix with a unit diagonal, for an inverse. Derived: rounding.
  double min_eigenvalue = 1e-13;
  // half the squared angle between two rays, below which they are parallel. Derived: rounding.
  double min_ray_divergence = 1e-14;
  // of a point without a picture, so that a step there is refused. Chosen.
  double large_residual_px = 1e6;
  double min_damping = 1e-3;      // after a refused step. Chosen.
  double inflation_sigmas = 3.0;  // misfit above which a point's covariance is inflated. Chosen.
};

// What a caller accepts, see `triangulate` there.
struct Gate {
  double max_sigma_mm, sigmas, tolerance_px;

  CMP_RECORD("extractor.space.triangulation.Gate", max_sigma_mm, sigmas, tolerance_px)
};

// The views of a rig.
struct PlacedViews {
  int count;
  std::array<PlacedView, MAX_VIEWS> views;
};

struct Points {
  Array<double, 2> xyz_mm;
  Array<double, 3> cov_mm2, by_pose;
  Array<double, 1> misfit, inflation;
  Array<std::uint8_t, 1> reason;

  CMP_RECORD("extractor.space.triangulation.Points", xyz_mm, cov_mm2, by_pose, misfit, inflation, reason)
};

// Triangulates N points of V views.
//
// xy_px (V, N, 2), NaN where unseen; cov_px2 (V, N, 2, 2); cov_pose (6 V, 6 V), zero where the poses are
// exact.
Points triangulate(const PlacedViews& views, View<const double, 3> xy_px, View<const double, 4> cov_px2,
                   View<const double, 2> cov_pose, const Gate& gate, const TriangulationLimits& limits);

// Inverses of symmetric matrices (N, 3, 3), each in its own scale; infinite variances where singular.
Array<double, 3> inverses(View<const double, 3> normal, const TriangulationLimits& limits);

}  // namespace cmp::space
