// Stage 7: numbers the cells by their places in the lattice, walking from face to face of the cell mesh.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// Limits of a walk; explained in extractor/numbering/lattice_walk.py.
struct WalkLimits {
  Index max_rounds;

  template <class F>
  static WalkLimits read(const F& f) {
    return {f["max_rounds"]};
  }
};

// Walks a component from its middle; contradicted cells are left out and the walk is repeated.
//
// center (N, 2) px, the cells' centers; faces (F, 3), neighbours (F, 3), orientation (F,) of the cell mesh;
// component (K,), its faces; front, the orientation of the faces that are markers; reach, the largest axial
// coordinate. The axial coordinates (N, 2), UNKNOWN_AXIAL for cells not walked to, the numbers of cells
// walked to and left out; no cells if contradictions remain.
std::tuple<Array<std::int32_t, 2>, std::int64_t, std::int64_t> walk_component(
    View<const double, 2> center, View<const std::int32_t, 2> faces, View<const std::int32_t, 2> neighbours,
    View<const std::int8_t, 1> orientation, View<const std::int64_t, 1> component, int front,
    std::int32_t reach, const WalkLimits& limits);

// The number of cells, of `count`, that have a face.
std::int64_t count_meshed_cells(View<const std::int32_t, 2> faces, View<const std::int8_t, 1> orientation,
                                Index count);

}  // namespace cmp::numbering
