// Between numbering and refinement: every marker's initial place, averaged from the cells that meet there.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"
#include "localmap/affine_maps.hpp"

namespace cmp::numbering {

// In edges, of corners on which triangles agree, where gridlines bend. Chosen.
inline constexpr double AGREED_DEVIATION = 0.04;
// In edges, between a marker's place by its gridlines and a correct initial place. Chosen.
inline constexpr double MAX_PLACE_ERROR = 0.1;

// Limits of corners; explained in extractor/numbering/marker_places.py.
struct CornerLimits {
  double max_corner_misfit, max_agreed_spread, predicted_weight;
  localmap::AffineMapLimits maps;

  template <class F>
  static CornerLimits read(const F& f) {
    return {f["max_corner_misfit"], f["max_agreed_spread"], f["predicted_weight"], f["maps"]};
  }
};

// The N cells of the image.
struct TriangularCells {
  View<const double, 2> center_px;  // (N, 2)
  View<const double, 3>
      corner_px;  // (N, 3, 2) of the triangles, clockwise; NaN where the region is no triangle

  CMP_FIELDS(center_px, corner_px)
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

// xy_px (M, 2), edge_px (M,), agreed (M,) and is_intact (M,) of InitialMarkers.
using InitialMarkers = std::tuple<Array<double, 2>, Array<double, 1>, Array<bool, 1>, Array<bool, 1>>;

// The corners of the cells merged at each of `markers` markers; corner_ids (U, 3), the markers of the
// layout's cells.
InitialMarkers merge_corners(const TriangularCells& cells, const CellNumbers& numbers,
                             const layout::LayoutCells& layout, View<const std::int32_t, 2> corner_ids,
                             Index markers, const CornerLimits& limits);

}  // namespace cmp::numbering
