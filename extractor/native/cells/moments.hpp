// The moments of a region's pixels up to the third order, and the triangle that has these moments.
#pragma once

#include <array>
#include <cmath>

#include "base/array.hpp"

namespace cmp::cells {

inline constexpr int MOMENT_TERMS = 10;  // 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy

// In coordinates in which its covariance is the identity, every triangle is equilateral with corners at the
// radius sqrt(8), and its third complex moment E[z^3] is 8^1.5 / 10 with 3 times the argument of a corner.
inline constexpr double CORNER_RADIUS = 2.8284271247461903;
inline constexpr double THIRD_MOMENT = 2.262741699796952;
inline constexpr double SINE_120 = 0.8660254037844386;
inline constexpr double TRIANGLE_SOLIDITY = 10.392304845413264;  // area over the root of the determinant

// Sums of the terms over a region's pixels.
struct MomentSums {
  std::array<double, MOMENT_TERMS> of{};

  double area() const { return of[0]; }
  void add(double x, double y) {
    const double xx = x * x, yy = y * y;
    of[0] += 1.0, of[1] += x, of[2] += y, of[3] += xx, of[4] += x * y, of[5] += yy;
    of[6] += xx * x, of[7] += xx * y, of[8] += x * yy, of[9] += yy * y;
  }
  void add(const MomentSums& other) {
    for (int k = 0; k < MOMENT_TERMS; ++k) of[k] += other.of[k];
  }
};

// The shape of a region, and what gives the corners of its triangle.
struct MomentShape {
  double x = 0.0, y = 0.0;             // the centre
  double triangularity = 0.0;          // 1 for a triangle, 0 for a disc, an ellipse or a square
  double solidity = 0.0;               // 1 for a triangle, 1.21 for an ellipse, less for ragged regions
  double elongation = 0.0;             // (trace of the covariance)^2 / determinant; 4 is equilateral
  double a = 0.0, b = 0.0, c = 0.0;    // the Cholesky factor of the covariance: a; b, c
  double real = 0.0, imaginary = 0.0;  // the third complex moment
};

// The shape by the sums; all zero for a region on one line.
inline MomentShape shape_of(const MomentSums& sums) {
  const auto& m = sums.of;
  const double n = m[0], mx = m[1] / n, my = m[2] / n;
  // a pixel is a square, not a point: it adds 1/12 to each variance
  const double xx = m[3] / n - mx * mx + 1.0 / 12.0, xy = m[4] / n - mx * my;
  const double yy = m[5] / n - my * my + 1.0 / 12.0;
  const double determinant = xx * yy - xy * xy, trace = xx + yy;
  MomentShape out;
  if (!(determinant > 0.0)) return out;
  out.x = mx, out.y = my;
  out.solidity = n / std::sqrt(determinant) / TRIANGLE_SOLIDITY;
  out.elongation = trace * trace / determinant;
  const double xxx = m[6] / n - 3 * mx * m[3] / n + 2 * (mx * mx * mx);
  const double xxy = m[7] / n - 2 * mx * m[4] / n - my * m[3] / n + 2 * mx * mx * my;
  const double xyy = m[8] / n - 2 * my * m[4] / n - mx * m[5] / n + 2 * mx * my * my;
  const double yyy = m[9] / n - 3 * my * m[5] / n + 2 * (my * my * my);
  // whitened z = L^-1 (p - mean), L the Cholesky factor of the covariance
  const double a = std::sqrt(xx), b = xy / a, c = std::sqrt(determinant / xx);
  const double ia = 1.0 / a, ic = 1.0 / c, ib = -b * ia * ic;
  const double uuu = ia * ia * ia * xxx, uuv = ia * ia * (ib * xxx + ic * xxy);
  const double uvv = ia * (ib * ib * xxx + 2 * ib * ic * xxy + ic * ic * xyy);
  const double vvv =
      ib * ib * ib * xxx + 3 * ib * ib * ic * xxy + 3 * ib * ic * ic * xyy + ic * ic * ic * yyy;
  out.a = a, out.b = b, out.c = c;
  out.real = uuu - 3 * uvv, out.imaginary = 3 * uuv - vvv;
  out.triangularity = std::sqrt(out.real * out.real + out.imaginary * out.imaginary) / THIRD_MOMENT;
  return out;
}

// Writes the corners (3, 2), clockwise with y down.
inline void fill_corners(const MomentShape& shape, View<double, 2> corners) {
  const double angle = std::atan2(shape.imaginary, shape.real) / 3.0;
  double u = CORNER_RADIUS * std::cos(angle), v = CORNER_RADIUS * std::sin(angle);
  for (int k = 0; k < 3; ++k) {
    corners(k, 0) = shape.x + shape.a * u;
    corners(k, 1) = shape.y + shape.b * u + shape.c * v;
    const double turned_u = -0.5 * u - SINE_120 * v;  // by 120 degrees
    v = SINE_120 * u - 0.5 * v;
    u = turned_u;
  }
}

// Limits of the shapes of triangles.
struct ShapeLimits {
  double max_elongation = 13.0;  // (trace of the covariance)^2 / determinant; 4 is equilateral. Chosen.
  // area over the root of the determinant of the covariance, relative to a triangle's; an ellipse has 1.21,
  // ragged regions have less. Chosen.
  double min_solidity = 0.7, max_solidity = 1.25;
  double ragged_weight = 1.5;  // of the difference between solidity and 1 in the quality of a shape. Chosen.

  // How much a region is a triangle: 1 at best, a little for a blurred one; negative for other shapes.
  double quality(const MomentShape& shape) const {
    const bool is_triangle = shape.elongation <= max_elongation && shape.solidity >= min_solidity &&
                             shape.solidity <= max_solidity;
    return is_triangle ? std::min(shape.triangularity, 1.0) - ragged_weight * std::abs(shape.solidity - 1.0)
                       : -1.0;
  }
};

}  // namespace cmp::cells
