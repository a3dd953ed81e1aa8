#include "cells/triangle_fit.hpp"

#include <cmath>
#include <vector>

namespace cmp::cells {

namespace {

// In coordinates in which its covariance is the identity, every triangle is equilateral with corners at the
// radius sqrt(8), and its third complex moment E[z^3] is 8^1.5 / 10 with 3 times the argument of a corner.
constexpr double CORNER_RADIUS = 2.8284271247461903;
constexpr double THIRD_MOMENT = 2.262741699796952;
constexpr double SINE_120 = 0.8660254037844386;

// The central moments of a region up to the third order, divided by its area.
struct CentralMoments {
  double x, y;  // the mean, relative to the seed
  double xx, xy, yy;
  double xxx, xxy, xyy, yyy;
};

CentralMoments central_moments(View<const double, 1> m) {
  const double n = m[0], mx = m[1] / n, my = m[2] / n;
  CentralMoments c;
  c.x = mx;
  c.y = my;
  // a pixel is a square, not a point: it adds 1/12 to each variance
  c.xx = m[3] / n - mx * mx + 1.0 / 12.0;
  c.xy = m[4] / n - mx * my;
  c.yy = m[5] / n - my * my + 1.0 / 12.0;
  c.xxx = m[6] / n - 3 * mx * m[3] / n + 2 * (mx * mx * mx);
  c.xxy = m[7] / n - 2 * mx * m[4] / n - my * m[3] / n + 2 * mx * mx * my;
  c.xyy = m[8] / n - 2 * my * m[4] / n - mx * m[5] / n + 2 * mx * my * my;
  c.yyy = m[9] / n - 3 * my * m[5] / n + 2 * (my * my * my);
  return c;
}

// Writes the corners (3, 2) of the triangle with these moments; false if the region is no triangle.
bool fill_triangle(const CentralMoments& m, double seed_x, double seed_y, const MomentLimits& limits,
                   View<double, 2> corners) {
  const double determinant = m.xx * m.yy - m.xy * m.xy, trace = m.xx + m.yy;
  if (determinant <= 0.0 || trace * trace > limits.max_elongation * determinant) return false;
  // whitened z = L^-1 (p - mean), L the Cholesky factor of the covariance
  const double a = std::sqrt(m.xx), b = m.xy / a, c = std::sqrt(determinant / m.xx);
  const double ia = 1.0 / a, ic = 1.0 / c, ib = -b * ia * ic;
  const double uuu = ia * ia * ia * m.xxx;
  const double uuv = ia * ia * (ib * m.xxx + ic * m.xxy);
  const double uvv = ia * (ib * ib * m.xxx + 2 * ib * ic * m.xxy + ic * ic * m.xyy);
  const double vvv =
      ib * ib * ib * m.xxx + 3 * ib * ib * ic * m.xxy + 3 * ib * ic * ic * m.xyy + ic * ic * ic * m.yyy;
  const double real = uuu - 3 * uvv, imaginary = 3 * uuv - vvv;
  if (std::hypot(real, imaginary) < limits.min_triangularity * THIRD_MOMENT) return false;
  const double angle = std::atan2(imaginary, real) / 3.0;
  double u = CORNER_RADIUS * std::cos(angle), v = CORNER_RADIUS * std::sin(angle);
  for (int k = 0; k < 3; ++k) {
    corners(k, 0) = seed_x + m.x + a * u;
    corners(k, 1) = seed_y + m.y + b * u + c * v;
    const double turned_u = -0.5 * u - SINE_120 * v;  // by 120 degrees
    v = SINE_120 * u - 0.5 * v;
    u = turned_u;
  }
  return true;
}

}  // namespace

FittedMoments fit_to_moments(View<const double, 2> moments, View<const std::int32_t, 2> seed,
                             const MomentLimits& limits) {
  const Index count = moments.size();
  Array<double, 3> corners({count, 3, 2}, 0.0);
  Array<bool, 1> good({count}, false);
  for (Index i = 0; i < count; ++i) {
    if (moments(i, 0) < limits.min_area_px) continue;
    good[i] = fill_triangle(central_moments(moments[i]), seed(i, 0), seed(i, 1), limits, corners[i]);
  }
  return {std::move(corners), std::move(good)};
}

FoundTriangles triangle_arrays(const image::PyramidLevel& view, View<const double, 2> moments,
                               View<const std::int32_t, 2> seed, View<const std::uint8_t, 1> ink, Index scale,
                               const TriangleLimits& limits) {
  auto [corners, good] = fit_to_moments(moments, seed, limits.moments);
  for (double& place : corners) place = (place + 0.5) * static_cast<double>(scale) - 0.5;
  update_triangle_corners(view, corners, good, limits.edges);
  const Index count = std::count(good.begin(), good.end(), true);
  Array<double, 3> kept({count, 3, 2});
  Array<std::uint8_t, 1> kept_ink({count});
  Array<std::int32_t, 1> region({count});
  Index t = 0;
  for (Index i = 0; i < good.size(); ++i) {
    if (!good[i]) continue;
    copy<double, 2>(corners[i], kept[t]);
    kept_ink[t] = ink[i];
    region[t] = static_cast<std::int32_t>(i);
    ++t;
  }
  return {std::move(kept), std::move(kept_ink), std::move(region)};
}

}  // namespace cmp::cells
