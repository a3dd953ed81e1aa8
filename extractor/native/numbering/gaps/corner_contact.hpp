// Cells in contact: neighbours in the pattern share a corner; a triangle's ink and corner determine its
// number.
//
// The only extrapolation is by one cell's own triangle to its neighbour, and back. corner_step is the number
// of corners from one corner of the layout's cell to the next, clockwise in the image: 1 from the back, 2
// from the front. first_corner is the triangle's corner that is corner 0 of the layout's cell.
#pragma once

#include <cmath>

#include "base/array.hpp"
#include "cells/cells.hpp"
#include "layout/lattice_tables.hpp"
#include "localmap/affine_maps.hpp"

namespace cmp::numbering {

inline constexpr std::int64_t UNKNOWN_CORNER = -1, NOT_EVALUATED = -2;

// Limits of contacts; explained in extractor/numbering/gaps/corner_contact.py.
struct CornerContactLimits {
  double max_corner_distance, max_predicted_distance, max_map_difference, max_neighbour_distance;
  localmap::AffineMapLimits maps;

  template <class F>
  static CornerContactLimits read(const F& f) {
    return {f["max_corner_distance"], f["max_predicted_distance"], f["max_map_difference"],
            f["max_neighbour_distance"], f["maps"]};
  }
};

// A cell of the image, its numbers side by side.
struct ImageTriangle {
  double x, y;                               // center, px
  std::array<double, 3> corner_x, corner_y;  // px; NaN where the region is no triangle
  double edge;                               // of an equilateral triangle of its area, px
};

// A cell of the layout, its numbers side by side.
struct LayoutTriangle {
  double x, y;            // center, mm
  double ax, ay, bx, by;  // from there to the corners 0 and 1, mm
  double area;            // of the parallelogram of the two, mm^2
};

// The N cells of the image and the U of the layout, and how the corners of the two run.
struct Contacts {
  Contacts(const cells::CellArrays& cells, const layout::LayoutCells& layout, Index corner_step,
           const CornerContactLimits& limits);

  const cells::CellArrays& cells;
  const layout::LayoutCells& layout;
  Index corner_step;
  const CornerContactLimits& limits;
  Array<ImageTriangle, 1> image_triangles;    // (N,)
  Array<LayoutTriangle, 1> layout_triangles;  // (U,)
};

// A numbering in progress, of N cells of the image and U of the layout.
struct PartialNumbering {
  Array<std::int32_t, 1> cell;          // (N,) the layout's cell of each cell of the image, or -1
  Array<bool, 1> free;                  // (U,) the layout's cells without a cell of the image
  Array<std::int64_t, 1> first_corner;  // (N,) which corner of a numbered cell's triangle is corner 0;
                                        // UNKNOWN_CORNER, NOT_EVALUATED before the first use
  Array<double, 3> maps;                // (N, 2, 2) px per mm, by `first_corner`
  Array<std::int32_t, 1>
      image_cell;  // (U,) the cells of the image at the beginning, or -1; they orient triangles
};

// The rows of points (N, 2) with these numbers (K,).
Array<double, 2> selected_points(View<const double, 2> points, View<const std::int64_t, 1> numbers);

// The numbers of the true values.
Array<std::int64_t, 1> numbers_of(View<const bool, 1> selected);

// The numbering that starts from copies of cell (N,) and free (U,).
PartialNumbering begin_numbering(View<const std::int32_t, 1> cell, View<const bool, 1> free);

// The edge of an equilateral triangle.
inline double equilateral_edge(double area) { return std::sqrt(area * 4.0 / std::sqrt(3.0)); }

// (N, 6), the numbered intact cells in contact with each numbered intact cell, in the order of
// NEIGHBOUR_STEPS, or -1.
//
// Cells are in contact if they are neighbours in the layout and share the corner that such neighbours share;
// where a triangle is missing, if their centers are close. cell (N,), the layout's cell of each cell of the
// image, or -1.
Array<std::int32_t, 2> corner_neighbours(const Contacts& contacts, View<const std::int32_t, 1> cell);

// Adds to corner_neighbours (N, 6) the contacts of the newly numbered cells is_new (N,).
void update_corner_neighbours(View<const bool, 1> is_new, const Contacts& contacts,
                              View<const std::int32_t, 1> cell, View<std::int32_t, 2> out);

// Orients the triangle of cell i, the layout's u, so that its map is most similar to the map `wanted` (2, 2).
//
// Writes the map to `out` (2, 2), which may be the same, and returns the first corner; UNKNOWN_CORNER where
// no map is similar or one is missing.
std::int64_t fill_map_by_similarity(const Contacts& contacts, Index i, Index u, View<const double, 2> wanted,
                                    View<double, 2> out);

// Numbers the cells in contact with numbered ones, the cells in contact with these, and so on.
//
// unnumbered (K,), the intact cells without a number that have a triangle; start, the numbered cells to begin
// with. (F,), the cells that were numbered.
Array<std::int64_t, 1> update_numbers_by_contact(const Contacts& contacts,
                                                 View<const std::int64_t, 1> unnumbered,
                                                 View<const std::int64_t, 1> start,
                                                 PartialNumbering& numbering);

// The first corner of the numbered cell i, or UNKNOWN_CORNER; evaluated and stored with its map at the first
// use.
std::int64_t update_first_corner(const Contacts& contacts, Index i, PartialNumbering& numbering);

}  // namespace cmp::numbering
