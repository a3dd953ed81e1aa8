// Measures the edges of triangles with sub-pixel accuracy, of many triangles together.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"

namespace cmp::cells {

// Limits of the measurement of edges.
struct TriangleEdgeLimits {
  // of an edge, from its start to the first profile, and from the second one to its end. Chosen.
  double first_profile = 0.25;
  std::int64_t half_profile = 4;  // samples on each side of an edge. Chosen.
  // from profiles to the last row and column; more than half a sub-pixel step. Derived.
  double border_margin_px = 0.01;
  // half length of a profile, in vectors from the cell's centre to the edge's middle. Chosen.
  double profile_reach = 0.5;
  // in units of the corner's distance from the centre; a triangle of which a corner moves farther is measured
  // again. Chosen: sharp cells move by 0.06, those of 6 px across by 0.15.
  double settled_shift = 0.1;
  std::int64_t max_passes = 2;  // Measured: rule "settled triangles".
  // of the disc in which the ink's color is measured, relative to the corner's distance from the centre.
  // Chosen.
  double ink_radius = 0.2;
  // of the disc of the color outside an edge, in vectors from the cell's centre to the edge's middle.
  // Derived: the middle of a neighbour as large.
  double background_place = 2.0;
  double background_radius = 0.4;  // of this disc, relative to the edge's distance from the centre. Chosen.
  double min_depth_px = 0.3;       // distance of a valid edge from the cell's centre. Chosen.
  // norm over the three 8-bit channels, between the ink and the color outside a valid edge. Chosen.
  double min_contrast = 12.0;
  double min_sine = 0.05;  // two edges that meet at less than 3 degrees have no corner. Chosen.
  // of a valid triangle, in units of the corner's distance from the centre. Chosen.
  double max_corner_shift = 1.0;
  // to which a profile's share of ink is limited. Chosen.
  double min_profile_level = -0.2, max_profile_level = 1.2;
  // of a squared contrast, to divide by. Derived: it only keeps a division from failing.
  double smallest_contrast = 1e-9;
};

// Moves the corners of triangles to the intersections of their measured edges.
//
// corners (N, 3, 2), px, clockwise in the image, are updated; good (N,), the triangles to measure, becomes
// false for those without valid edges.
void update_triangle_corners(const image::PyramidLevel& view, View<double, 3> corners, View<bool, 1> good,
                             const TriangleEdgeLimits& limits);

}  // namespace cmp::cells
