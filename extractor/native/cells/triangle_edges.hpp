// Measures the edges of triangles with sub-pixel accuracy, of many triangles together.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"

namespace cmp::cells {

// The limits of the measurement; the Python module explains them.
struct TriangleEdgeLimits {
  double first_profile;
  std::int64_t half_profile;
  double border_margin_px;
  double profile_reach;
  double fine_reach_px;
  double next_reach;
  std::int64_t max_passes;
  double ink_radius;
  double background_place;
  double background_radius;
  double min_depth_px;
  double min_contrast;
  double min_sine;
  double max_corner_shift;
  double min_profile_level;
  double max_profile_level;
  double smallest_contrast;

  template <class F>
  static TriangleEdgeLimits read(const F& f) {
    return {f["first_profile"],    f["half_profile"],      f["border_margin_px"],  f["profile_reach"],
            f["fine_reach_px"],    f["next_reach"],        f["max_passes"],        f["ink_radius"],
            f["background_place"], f["background_radius"], f["min_depth_px"],      f["min_contrast"],
            f["min_sine"],         f["max_corner_shift"],  f["min_profile_level"], f["max_profile_level"],
            f["smallest_contrast"]};
  }
};

// Moves the corners of triangles to the intersections of their measured edges.
//
// The first profiles reach across the cell; for large cells shorter ones follow. corners (N, 3, 2), px,
// clockwise in the image, are updated; good (N,), the triangles to measure, becomes false for those without
// valid edges.
void update_triangle_corners(const image::PyramidLevel& view, View<double, 3> corners, View<bool, 1> good,
                             const TriangleEdgeLimits& limits);

}  // namespace cmp::cells
