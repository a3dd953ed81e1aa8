// Stage 6: the cell mesh, a triangular mesh through the cells' centers.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::cells {

// The limits of the mesh; the Python module explains them.
struct CellMeshLimits {
  std::int64_t max_flip_rounds;
  double min_area_ratio;
  double max_area_ratio;
  double max_swelling;
  double max_corner_gap;

  template <class F>
  static CellMeshLimits read(const F& f) {
    return {f["max_flip_rounds"], f["min_area_ratio"], f["max_area_ratio"], f["max_swelling"],
            f["max_corner_gap"]};
  }
};

// The mesh of F faces: faces (F, 3), the red, green and blue cell of each, -1 thrice for no face; neighbours
// (F, 3), the face across the edge opposite to each cell, or -1; orientation (F,), +1 where red, green, blue
// run clockwise in the image, -1 counter-clockwise, 0 no face.
using ClassifiedFaces = std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 2>, Array<std::int8_t, 1>>;

// Flips edges between cells of one ink where the other diagonal joins two other inks.
//
// points (N, 2), ink (N,); faces (F, 3) and neighbours (F, 3) are updated.
void update_flipped_edges(View<const double, 2> points, View<const std::uint8_t, 1> ink,
                          View<std::int32_t, 2> faces, View<std::int32_t, 2> neighbours,
                          const CellMeshLimits& limits);

// Corners as red, green, blue; only triangles that are markers or black cells.
//
// points (N, 2), ink (N,), area (N,), corner (N, 3, 2) of the cells; faces (F, 3), neighbours (F, 3).
ClassifiedFaces classify_faces(View<const double, 2> points, View<const std::uint8_t, 1> ink,
                               View<const double, 1> area, View<const double, 3> corner,
                               View<const std::int32_t, 2> faces, View<const std::int32_t, 2> neighbours,
                               const CellMeshLimits& limits);

// Sides of the cells' triangles over those at which neighbours just meet; there a face is as large as the
// triangles of its cells.
//
// points (N, 2), ink (N,), corner (N, 3, 2) of the cells; faces (F, 3).
double swelling(View<const double, 2> points, View<const std::uint8_t, 1> ink, View<const double, 3> corner,
                View<const std::int32_t, 2> faces, const CellMeshLimits& limits);

// The corners (N, 3, 2) of cells whose sides are divided by the swelling, around their centers (N, 2).
Array<double, 3> without_swelling(View<const double, 2> center, View<const double, 3> corner,
                                  double swelling);

}  // namespace cmp::cells
