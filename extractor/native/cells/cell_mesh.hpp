// Stage 6: which cells share a corner, from the cells' triangles alone.
#pragma once

#include "base/array.hpp"

namespace cmp::cells {

// Limits of the mesh.
struct CellMeshLimits {
  // L of eq. 5, in edges of the smaller cell, between two corners while the swelling is unknown; the next
  // corner is an edge away. Chosen.
  double first_tolerance = 0.65;
  double tolerance = 0.4;  // the same with the swelling. Chosen.
  // in edges, between a neighbour's centre and where a cell's own triangle expects it. Chosen.
  double direction_tolerance = 0.56;
  double min_swelling = 0.6, max_swelling = 1.6;  // of a whole image. Chosen.
};

inline constexpr Index STEPS = 6;
// The corners i, j of each step: a neighbour shares corner i with a cell, and has the shared corner where the
// cell has corner j.
inline constexpr int STEP_CORNERS[STEPS][2] = {{1, 0}, {0, 1}, {2, 0}, {0, 2}, {1, 2}, {2, 1}};

// The links of N cells.
struct CellLinks {
  Array<std::int32_t, 2> neighbours;  // (N, 6) the cell at each step, or -1
  Array<std::int8_t, 2> back;         // (N, 6) the step by which that cell leads back
  Array<double, 2> misfit;  // (N, 6) the distance between the two corners, in edges of the smaller cell

  CMP_RECORD("extractor.cells.cell_mesh.CellLinks", neighbours, back, misfit)
};

// The links; the swelling: sides of the triangles over those at which neighbours just meet.
using LinkedCells = std::tuple<CellLinks, double>;

// centre (N, 2), corner (N, 3, 2) clockwise in the image.
LinkedCells link_cells(View<const double, 2> centre, View<const double, 3> corner,
                       const CellMeshLimits& limits);

}  // namespace cmp::cells
