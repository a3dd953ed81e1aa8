// Lenses: places of directions with derivatives, and the inverse; the models are in extractor/space/lens.py.
#pragma once

#include <array>

#include "space/small_matrices.hpp"

namespace cmp::space {

// Limits of the derivatives and of the inverse.
struct LensLimits {
  std::int64_t max_iterations = 60;  // of Newton's method. Chosen.
  std::int64_t max_halvings = 12;    // of a step. Chosen.
  double converged = 1e-13;          // error in normalised coordinates, far below that of a pixel. Chosen.
  double accepted = 1e-9;            // error in normalised coordinates of the worst inverse. Chosen.
  double start_rad =
      1.5;             // largest angle from the axis at which the inverse of a fisheye lens starts. Chosen.
  double axis = 1e-4;  // radius below which the derivative of t / r is a series. Derived: rounding.
};

struct Lens {
  bool is_fisheye;
  std::array<double, 12> k;  // k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, or k1 k2 k3 k4 of a fisheye lens
  double fold_radius;
  LensLimits limits{};

  CMP_RECORD("extractor.space.lens.LensTable", is_fisheye, k, fold_radius)
};

// A place in the image, in focal lengths from the principal point, and its derivatives by the direction.
struct Place {
  Vector<2> xy;
  Matrix<2, 2> by_direction;
};

Place distorted(const Lens& lens, const Vector<2>& direction);

// The direction of a place; NaN without an inverse within the fold radius.
Vector<2> undistorted(const Lens& lens, const Vector<2>& place);

}  // namespace cmp::space
