// Lenses: places of directions with derivatives, and the inverse; the models are in extractor/space/lens.py.
#pragma once

#include <array>

#include "space/small_matrices.hpp"

namespace cmp::space {

// A lens and the limits of its inverse, which extractor/space/lens.py explains.
struct Lens {
  bool is_fisheye;
  std::array<double, 12> k;  // k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, or k1 k2 k3 k4 of a fisheye lens
  double fold_radius;
  std::int64_t max_iterations, max_halvings;
  double converged, accepted, start_rad, axis;

  template <class F>
  static Lens read(const F& f) {
    return {f["is_fisheye"],   f["k"],         f["fold_radius"], f["max_iterations"],
            f["max_halvings"], f["converged"], f["accepted"],    f["start_rad"],
            f["axis"]};
  }
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
