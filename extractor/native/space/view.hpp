// A placed view: pictures of points with derivatives, and lines of sight; see extractor/space/camera.py and
// medium.py.
#pragma once

#include "space/lens.hpp"

namespace cmp::space {

// Window and gel before a camera, in its frame; see PlacedWindow.
struct Window {
  bool is_there;
  double gel_index, window_mm, window_index;
  Vector<3> normal;
  double distance_mm;
  Matrix<3, 6> normal_by_pose;
  Matrix<1, 6> distance_by_pose;
  std::int64_t max_iterations;
  double converged, touching_mm;

  template <class F>
  static Window read(const F& f) {
    const View<const double, 1> normal = f["normal"], by_pose = f["distance_by_pose"];
    Window out{f["is_there"],
               f["gel_index"],
               f["window_mm"],
               f["window_index"],
               {},
               f["distance_mm"],
               Matrix<3, 6>::copied(f["normal_by_pose"]),
               {},
               f["max_iterations"],
               f["converged"],
               f["touching_mm"]};
    for (int k = 0; k < 3; ++k) out.normal[k] = normal[k];
    for (int k = 0; k < 6; ++k) out.distance_by_pose[k] = by_pose[k];
    return out;
  }

  // The gel between the window and a point; NaN where the camera does not see the point.
  double gel_depth_mm(const Vector<3>& camera) const;
};

struct PlacedView {
  Vector<2> focal_px, centre_px;
  Lens lens;
  Matrix<3, 3> rotation;
  Vector<3> shift_mm;
  Window window;

  template <class F>
  static PlacedView read(const F& f) {
    const std::array<double, 2> focal = f["focal_px"], centre = f["centre_px"];
    const View<const double, 1> shift = f["shift_mm"];
    return {{focal}, {centre}, f["lens"], Matrix<3, 3>::copied(f["rotation"]), {{shift[0], shift[1], shift[2]}},
            f["window"]};
  }

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
