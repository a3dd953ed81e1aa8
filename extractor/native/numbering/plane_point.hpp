// A point of the image or of the lattice.
#pragma once

namespace cmp::numbering {

struct PlanePoint {
  double x, y;
};

inline double squared_distance(PlanePoint a, PlanePoint b) {
  const double x = a.x - b.x, y = a.y - b.y;
  return x * x + y * y;
}

}  // namespace cmp::numbering
