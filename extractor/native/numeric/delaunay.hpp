// Delaunay triangulation of points in the plane, with the triangles' neighbours (Lawson 1977).
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numeric {

struct Triangulation {
  Array<std::int32_t, 2> faces;       // (F, 3) corners, turning from x to y
  Array<std::int32_t, 2> neighbours;  // (F, 3) the triangle across the edge opposite to each corner, or -1
};

// The Delaunay triangles of finite points (N, 2).
Triangulation triangulate(View<const double, 2> points);
std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 2>> delaunay(View<const double, 2> points);

}  // namespace cmp::numeric
