// Stage 7, the spin-search algorithm (SSA): walks from cell to cell around their common corners.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// The limits of a walk; the Python module explains them.
struct WalkLimits {
  std::int64_t max_rounds;

  template <class F>
  static WalkLimits read(const F& f) {
    return {f["max_rounds"]};
  }
};

// The links of N cells; see cells/cell_mesh.hpp.
struct CellLinks {
  View<const std::int32_t, 2> neighbours;  // (N, 6)
  View<const std::int8_t, 2> back;         // (N, 6)
  View<const double, 2> misfit;            // (N, 6)

  CMP_FIELDS(neighbours, back, misfit)
};

// (N, 2) axial coordinates of the cells, (N,) the corner that is corner 0, (N,) the part, or -1 for a cell
// without consistent links; and the number of links that contradicted the walk.
//
// Every part has a frame of its own. Corner 1 follows corner 0 clockwise in the image: the coordinates are
// those of a pattern seen from its back.
using Walked =
    std::tuple<Array<std::int32_t, 2>, Array<std::int8_t, 1>, Array<std::int32_t, 1>, std::int64_t>;

Walked walk_cells(const CellLinks& links, const WalkLimits& limits);

}  // namespace cmp::numbering
