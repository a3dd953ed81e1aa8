// Stage 6: which cells share a corner, from the cells' triangles alone.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::cells {

// The limits of the mesh; the Python module explains them.
struct CellMeshLimits {
  double first_tolerance, tolerance, direction_tolerance, min_swelling, max_swelling;

  template <class F>
  static CellMeshLimits read(const F& f) {
    return {f["first_tolerance"], f["tolerance"], f["direction_tolerance"], f["min_swelling"],
            f["max_swelling"]};
  }
};

inline constexpr Index STEPS = 6;
// The corners i, j of each step: a neighbour shares corner i with a cell, and has the shared corner where the
// cell has corner j.
inline constexpr int STEP_CORNERS[STEPS][2] = {{1, 0}, {0, 1}, {2, 0}, {0, 2}, {1, 2}, {2, 1}};

// The links of N cells: the cell at each step (N, 6), or -1; the step by which that cell leads back (N, 6);
// and the distance between the two corners, in edges of the smaller cell (N, 6). Then the swelling: sides of
// the triangles over those at which neighbours just meet.
using CellLinks = std::tuple<Array<std::int32_t, 2>, Array<std::int8_t, 2>, Array<double, 2>, double>;

// center (N, 2), corner (N, 3, 2) clockwise in the image.
CellLinks link_cells(View<const double, 2> center, View<const double, 3> corner,
                     const CellMeshLimits& limits);

}  // namespace cmp::cells
