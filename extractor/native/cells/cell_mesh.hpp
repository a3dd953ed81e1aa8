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

// The image's N colored cells.
struct MeshedCells {
  View<const double, 2> center_px;  // (N, 2)
  View<const std::uint8_t, 1> ink;  // (N,) 1 red, 2 green, 3 blue
  View<const double, 1> area_px;    // (N,) px^2
  View<const double, 3> corner_px;  // (N, 3, 2) NaN where the region is no triangle

  template <class F>
  static MeshedCells read(const F& f) {
    return {f["center_px"], f["ink"], f["area_px"], f["corner_px"]};
  }
};

// The mesh of F faces: faces (F, 3), the red, green and blue cell of each, -1 thrice for no face; neighbours
// (F, 3), the face across the edge opposite to each cell, or -1; orientation (F,), +1 where red, green, blue
// run clockwise in the image, -1 counter-clockwise, 0 no face; the swelling; and the number of faces that are
// some.
using CellMesh =
    std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 2>, Array<std::int8_t, 1>, double, std::int64_t>;

// The Delaunay triangles of the centers, corrected by color.
CellMesh build_cell_mesh(const MeshedCells& cells, const CellMeshLimits& limits);

// The corners (N, 3, 2) of cells whose sides are divided by the swelling, around their centers (N, 2).
Array<double, 3> without_swelling(View<const double, 2> center, View<const double, 3> corner,
                                  double swelling);

}  // namespace cmp::cells
