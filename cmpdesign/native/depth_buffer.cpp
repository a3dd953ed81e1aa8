// A depth buffer for pictures of meshes.
#include "base/binding.hpp"

#include <cmath>

namespace cmp {

namespace {

// The pixels from the smallest to the largest of three coordinates, within a side of `limit` px.
std::array<Index, 2> pixel_range(double a, double b, double c, Index limit) {
  const double first = std::ceil(std::min({a, b, c})), last = std::floor(std::max({a, b, c}));
  return {static_cast<Index>(std::clamp(first, 0.0, static_cast<double>(limit))),
          static_cast<Index>(std::clamp(last, -1.0, static_cast<double>(limit - 1)))};
}

// Draws triangles into a depth buffer.
//
// corners (T, 3, 3): x and y in px (y down) and z towards the viewer. depth (H, W): the largest z of each
// pixel, updated. number (H, W): the triangle with that z, updated.
void fill_depth_buffer(View<const double, 3> corners, View<double, 2> depth, View<std::int64_t, 2> number) {
  for (Index t = 0; t < corners.size(); ++t) {
    const double ax = corners(t, 0, 0), ay = corners(t, 0, 1), bx = corners(t, 1, 0), by = corners(t, 1, 1);
    const double cx = corners(t, 2, 0), cy = corners(t, 2, 1);
    const double area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    // with y down, the corners of a triangle that faces the viewer run clockwise: a negative area
    if (!(area < 0.0)) continue;
    const auto [top, bottom] = pixel_range(ay, by, cy, depth.size(0));
    const auto [left, right] = pixel_range(ax, bx, cx, depth.size(1));
    for (Index row = top; row <= bottom; ++row) {
      for (Index column = left; column <= right; ++column) {
        const auto x = static_cast<double>(column), y = static_cast<double>(row);
        const double u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area;
        const double v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area;
        const double w = 1.0 - u - v;
        if (!(u >= 0.0 && v >= 0.0 && w >= 0.0)) continue;
        const double z = u * corners(t, 0, 2) + v * corners(t, 1, 2) + w * corners(t, 2, 2);
        if (z > depth(row, column)) {
          depth(row, column) = z;
          number(row, column) = t;
        }
      }
    }
  }
}

}  // namespace

void add_depth_buffer(nb::module_ module) {
  bind<&fill_depth_buffer>(module, "fill_depth_buffer", {"corners", "depth", "number"});
}

}  // namespace cmp
