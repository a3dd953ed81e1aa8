// Between numbering and refinement: every marker's initial place, averaged from the cells that meet there.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "localmap/neighbour_prediction.hpp"

namespace cmp::numbering {

// Limits of corners; explained in extractor/numbering/marker_places.py.
struct CornerLimits {
  double max_corner_misfit, max_agreed_spread, predicted_weight;

  template <class F>
  static CornerLimits read(const F& f) {
    return {f["max_corner_misfit"], f["max_agreed_spread"], f["predicted_weight"]};
  }
};

// The N cells of the image with their local maps.
struct MappedCells {
  View<const double, 2> center_px;   // (N, 2)
  View<const double, 3> corner_px;   // (N, 3, 2) of the triangles, clockwise
  View<const double, 3> slope;       // (N, 2, 2) px per mm, NaN where unknown
  View<const std::int32_t, 1> cell;  // (N,) the layout's cell, or -1
  bool mirrored;                     // the pattern is seen from its back

  template <class F>
  static MappedCells read(const F& f) {
    return {f["center_px"], f["corner_px"], f["slope"], f["cell"], f["mirrored"]};
  }
};

// The corners of the C numbered cells with a local map, by the layout's corners 0, 1, 2.
struct CellCorners {
  View<const std::int32_t, 2> ids;  // (C, 3) marker ids
  View<const double, 3> corner_px;  // (C, 3, 2) of the cell's triangle where that is fitted, else predicted
  View<const double, 1> edge_px;    // (C,) the mean predicted edge
  View<const bool, 1> is_fitted;    // (C,) the triangle agrees with the prediction

  template <class F>
  static CellCorners read(const F& f) {
    return {f["ids"], f["corner_px"], f["edge_px"], f["is_fitted"]};
  }
};

// The fields of CellCorners.
using CellCornerArrays =
    std::tuple<Array<std::int32_t, 2>, Array<double, 3>, Array<double, 1>, Array<bool, 1>>;
// xy_px (M, 2), edge_px (M,), agreeing (M,) of _MergedCorners.
using MergedCornerArrays = std::tuple<Array<double, 2>, Array<double, 1>, Array<std::int64_t, 1>>;

// The corners of the cells with a slope.
//
// vectors_mm (U, 3, 2) from the layout's centers to the corners; corner_ids (U, 3), their markers.
CellCornerArrays cell_corners(const MappedCells& cells, View<const double, 3> vectors_mm,
                              View<const std::int32_t, 2> corner_ids, const CornerLimits& limits);

// The corners merged at each of `count` markers.
MergedCornerArrays average_corners(const CellCorners& corners, Index count, const CornerLimits& limits);

}  // namespace cmp::numbering
