// Between numbering and refinement: every marker's initial place, averaged from the cells that meet there.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"

namespace cmp::numbering {

// In edges, of corners on which triangles agree, where gridlines bend. Chosen.
inline constexpr double AGREED_DEVIATION = 0.04;
// In edges, between a marker's place by its gridlines and a correct initial place. Chosen.
inline constexpr double MAX_PLACE_ERROR = 0.1;

// Limits of corners.
struct CornerLimits {
  // in edges, between a triangle's corner and its prediction by the cell's neighbours. Measured: rule "corner
  // misfit".
  double max_corner_misfit = 0.28;
  // in the triangle's shortest edge, between a corner and the mean of its marker's corners, where these
  // agree. Chosen.
  double max_agreed_spread = 0.2;
  // of a predicted corner, relative to a corner of a fitted triangle. Chosen.
  double predicted_weight = 0.05;
  // least ratio of a cell's neighbours' spread across to along; below it they lie on one line. Chosen.
  double min_spread = 0.2;
  // of the distance to a neighbour, from its centre to the prediction by the cell's triangle. Measured: rule
  // "mapped by triangle".
  double max_triangle_misfit = 0.3;
  // the same for the triangle rotated by 120 degrees, which mispredicts by 1.7 distances. Chosen below that.
  double min_rival_misfit = 0.8;
};

// The N cells of the image.
struct TriangularCells {
  View<const double, 2> centre_px;  // (N, 2)
  View<const double, 3>
      corner_px;  // (N, 3, 2) of the triangles, clockwise; NaN where the region is no triangle

  CMP_FIELDS(centre_px, corner_px)
};

// The numbers of these cells.
struct CellNumbers {
  View<const std::int32_t, 1> cell;  // (N,) the layout's cell, or -1
  bool mirrored;                     // the pattern is seen from its back

  CMP_FIELDS(cell, mirrored)
};

// Whether the triangles that agree at a marker are all that meet there, or at least two; and whether they are
// both.
struct CornerAgreement {
  bool agreed, is_intact;

  CornerAgreement(Index agreeing, Index meeting)
      : agreed(agreeing == meeting || agreeing >= 2), is_intact(agreeing == meeting && agreeing >= 2) {}
};

// The markers before refinement; the Python class explains them.
struct InitialMarkers {
  Array<double, 2> xy_px;            // (M, 2)
  Array<double, 1> edge_px;          // (M,)
  Array<bool, 1> agreed, is_intact;  // (M,)

  CMP_RECORD("extractor.numbering.marker_places.InitialMarkers", xy_px, edge_px, agreed, is_intact)
};

// The corners of the cells merged at each of `markers` markers; corner_ids (U, 3), the markers of the
// layout's cells.
InitialMarkers merge_corners(const TriangularCells& cells, const CellNumbers& numbers,
                             const layout::LayoutCells& layout, View<const std::int32_t, 2> corner_ids,
                             Index markers, const CornerLimits& limits);

}  // namespace cmp::numbering
