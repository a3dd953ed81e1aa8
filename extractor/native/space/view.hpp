// A placed view: pictures of points with derivatives, and lines of sight; see extractor/space/camera.py and
// medium.py.
#pragma once

#include "space/lens.hpp"

namespace cmp::space {

// Limits of Newton's method for the picture of a point behind a window.
struct WindowLimits {
  std::int64_t max_iterations = 50;  // about 5 are needed. Chosen.
  double converged = 1e-9;           // last step, of 1 + q: the error is about its square. Chosen.
  double touching_mm = 1e-9;         // by which a pattern on the window may lie within it. Derived: rounding.
};

// Window and gel before a camera, in its frame; see PlacedWindow.
struct Window {
  bool is_there;
  double gel_index, window_mm, window_index;
  Vector<3> normal;
  double distance_mm;
  Matrix<3, 6> normal_by_pose;
  Vector<6> distance_by_pose;
  WindowLimits limits{};

  CMP_RECORD("extractor.space.medium.PlacedWindow", is_there, gel_index, window_mm, window_index, normal,
             distance_mm, normal_by_pose, distance_by_pose)

  // The gel between the window and a point; NaN where the camera does not see the point.
  double gel_depth_mm(const Vector<3>& camera) const;
};

struct PlacedView {
  Vector<2> focal_px, centre_px;
  Lens lens;
  Matrix<3, 3> rotation;
  Vector<3> shift_mm;
  Window window;

  CMP_RECORD("extractor.space.camera.PlacedViewTable", focal_px, centre_px, lens, rotation, shift_mm, window)

  bool is_ahead(const Vector<3>& xyz_mm) const;
};

// The picture of a point and its derivatives, see Linearisation; NaN without one.
struct Picture {
  Vector<2> xy_px, direction;
  Matrix<2, 3> by_point;
  Matrix<2, 6> by_pose;
};

Picture picture(const PlacedView& view, const Vector<3>& xyz_mm);

// A line of sight at the pattern; NaN without one.
struct Ray {
  Vector<3> origin_mm, direction;
};

Ray ray(const PlacedView& view, const Vector<2>& xy_px);

}  // namespace cmp::space
