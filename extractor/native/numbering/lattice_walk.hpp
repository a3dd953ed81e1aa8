// Stage 7, the spin-search algorithm (SSA): walks from cell to cell around their common corners.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// The links of N cells; see cells/cell_mesh.hpp.
struct CellLinks {
  View<const std::int32_t, 2> neighbours;  // (N, 6)
  View<const std::int8_t, 2> back;         // (N, 6)
  View<const double, 2> misfit;            // (N, 6)

  CMP_FIELDS(neighbours, back, misfit)
};

// The limits of inks at links; the Python module explains them.
struct LinkInkLimits {
  double likeness, least_difference;

  template <class F>
  static LinkInkLimits read(const F& f) {
    return {f["likeness"], f["least_difference"]};
  }
};

// The limits of a walk; the Python module explains them.
struct WalkLimits {
  std::int64_t max_rounds, min_hole_neighbours;
  LinkInkLimits inks;

  template <class F>
  static WalkLimits read(const F& f) {
    return {f["max_rounds"], f["min_hole_neighbours"], f["inks"]};
  }
};

// (N, 2) axial coordinates of the cells, (N,) the corner that is corner 0, (N,) the part, or -1 for a cell
// without consistent links; the number of links that contradicted the walk, and of places without a cell
// among the cells of the parts.
//
// Every part has a frame of its own. Corner 1 follows corner 0 clockwise in the image: the coordinates are
// those of a pattern seen from its back.
using Walked =
    std::tuple<Array<std::int32_t, 2>, Array<std::int8_t, 1>, Array<std::int32_t, 1>, std::int64_t,
               std::int64_t>;

// Walks over all linked cells, along links that the cells' light (N, 3), NaN unknown, does not contradict.
Walked walk_cells(const CellLinks& links, View<const double, 2> light, const WalkLimits& limits);

}  // namespace cmp::numbering
