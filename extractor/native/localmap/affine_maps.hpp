// Local linear maps from the layout to the image around every numbered cell, in pixels per millimetre.
#pragma once

#include "layout/lattice_tables.hpp"

namespace cmp::localmap {

// Limits of linear maps.
struct AffineMapLimits {
  // least ratio of the neighbours' spread across to along; below it they lie on one line. Chosen.
  double min_spread = 0.2;
  // of the distance to a neighbour, from its center to the prediction by a triangle. Measured: rule "mapped
  // by triangle".
  double max_misfit = 0.3;
  // the same for the triangle rotated by 120 degrees, which mispredicts by 1.7 distances. Chosen below that.
  double min_rival_misfit = 0.8;

  template <class F>
  static AffineMapLimits read(const F& f) {
    return {f["min_spread"], f["max_misfit"], f["min_rival_misfit"]};
  }
};

// Inverts the numbering: (U,) the cell of the image that each of `count` cells of the layout is, or -1.
//
// cell (N,): the layout's cell of each cell of the image, or -1.
Array<std::int32_t, 1> image_cell_of_layout_cell(View<const std::int32_t, 1> cell, Index count);

// Writes the linear map (2, 2) around cell i of the image, which is the layout's cell u; see linear_maps.
void fill_linear_map(Index i, View<const double, 2> center_px, Index u,
                     View<const std::int32_t, 1> image_cell, const layout::LayoutCells& layout,
                     View<double, 2> out, const AffineMapLimits& limits);

// (N, 2, 2) px per mm, the linear map around each numbered cell, by least squares over its six neighbours;
// NaN without a number and where the neighbours lie on one line.
//
// The millimetres of the layout contain the pattern's own shape, so a round pattern is no more curved than a
// honeycomb.
//
// center_px (N, 2) the cells' centers; cell (N,) the layout's cell of each cell of the image, or -1;
// image_cell (U,) the inverse, by image_cell_of_layout_cell.
Array<double, 3> linear_maps(View<const double, 2> center_px, View<const std::int32_t, 1> cell,
                             View<const std::int32_t, 1> image_cell, const layout::LayoutCells& layout,
                             const AffineMapLimits& limits);

// linear_maps, completed by triangles where a cell has too few neighbours, at the rims of holes.
//
// A cell's own triangle gives its map if a neighbour shows which of its corners is which.
//
// corner_px (N, 3, 2) the cells' triangles, clockwise, or NaN; mirrored: the pattern is seen from its back.
Array<double, 3> completed_linear_maps(View<const double, 2> center_px, View<const double, 3> corner_px,
                                       View<const std::int32_t, 1> cell, bool mirrored,
                                       const layout::LayoutCells& layout, const AffineMapLimits& limits);

}  // namespace cmp::localmap
