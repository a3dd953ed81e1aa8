// The coverage of pixels by a cell: the cell's share in a pixel under a Gaussian, the blur of optics and
// pixel in one.
//
// The three sides of a cell are half planes, and every two of them form a wedge (gaussian). By inclusion and
// exclusion
//
//   share = wedge01 + wedge12 + wedge20 - side0 - side1 - side2 + 1,
//
// which is the wedge of two sides where the third is far. The pixels of a cell stand in arrays and are
// computed together, without tables and branches. Their places count from a pixel near the cell's middle, so
// that float32 is precise enough.
#pragma once

#include <array>

#include "base/array.hpp"
#include "numeric/gaussian.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

// A side of a cell, in units of the blur.
struct CellSide {
  std::array<double, 3> distance;  // inside the side: 0 + 1 x + 2 y
  std::array<double, 3> along;     // place along the side from its first corner, likewise
  double length;
  double leave, arrive;  // slopes at the first and the second corner, positive inwards
};

// The sides and corners of one cell.
struct CellOutline {
  std::array<CellSide, 3> sides;
  std::array<numeric::CornerTerms, 3> corners;  // between each side and the next one
  // in units of the blur, the distance from a chord beyond which a pixel's share no longer changes
  double far;
};

// A column of the pixels of a cell; up to one lane more is overwritten.
using CellColumn = std::array<float, CHUNK + PIXEL_LANES>;

// The pixels of a cell.
struct alignas(64) CellPixels {
  CellColumn x, y;                     // px, the places
  std::array<CellColumn, 3> distance;  // inside each of the three sides, in units of the blur
  std::array<std::int32_t, CHUNK + PIXEL_LANES> corner;  // the number of the nearest one
  CellColumn wedge;  // the shares of wedges less the products of their sides' shares
  CellColumn share;  // of the cell in the pixels
  std::array<float, 3 * (CHUNK + PIXEL_LANES)> color;  // share times color, three channels of each pixel
};

// Fills in the sides and corners of a cell.
//
// cell (3,) marker ids; cell_edges (3,), its edges; edges (E, 2); lines (E, 8); turn is the sign of (b - a) x
// (c - a) of its corners; sigma px, the blur.
CellOutline cell_outline(View<const std::int32_t, 1> cell, View<const std::int32_t, 1> cell_edges,
                         View<const std::int32_t, 2> edges, View<const double, 2> lines, double turn,
                         double sigma);

// The ends in x of rows, px.
struct RowSpan {
  double left, right;
};

// Fills in the ends in x of `count` rows from y = top on, between left and right, px: a row lies less than
// `far`, in units of the blur, outside every side.
void fill_row_ends(const CellOutline& outline, double top, Index count, const RowSpan& most,
                   View<double, 1> low, View<double, 1> high);

// Fills in the shares of a cell in pixels, whose places are px from (x0, y0).
void fill_coverage(Index count, double x0, double y0, const CellOutline& outline, CellPixels& pixels);

}  // namespace cmp::refine
