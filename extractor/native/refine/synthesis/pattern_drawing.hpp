// Drawing of the pattern from its current markers.
//
// A pixel of the drawing is the sum over the cells of the cell's share in that pixel (cell_coverage) times
// its level over black.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

// The cells of the pattern in the image.
struct CellGeometry {
  View<const double, 2> xy;                // (M, 2) px, the markers
  View<const std::int32_t, 2> cells;       // (K, 3) marker ids of the corners
  View<const std::int32_t, 2> cell_edges;  // (K, 3), edge k runs between the corners k and k + 1
  View<const std::int32_t, 2> edges;       // (E, 2) marker ids
  View<const double, 2> lines;             // (E, 8), as gridlines gives them
};

// The colors of the cells over black, and the blur of their edges.
struct CellAppearance {
  View<const double, 2> levels;  // (K, 3) gray levels at the centroids
  View<const double, 3> slopes;  // (K, 3, 2) gray levels per px along x and y
  double sigma;                  // px, the blur
};

// Draws all cells whose sides are known over zeros.
//
// box (4,) px, x from, y from, x to, y to; nothing is written outside. model (H, W, 3), the drawing.
void draw_cells(const CellGeometry& geometry, const CellAppearance& appearance,
                View<const std::int64_t, 1> box, View<float, 3> model);

}  // namespace cmp::refine
