// Stage 7, the spin-search algorithm (SSA): walks from cell to cell around their common corners.
#pragma once

#include "base/array.hpp"

namespace cmp::numbering {

// The links of N cells; see cells/cell_mesh.hpp.
struct CellLinks {
  View<const std::int32_t, 2> neighbours;  // (N, 6)
  View<const std::int8_t, 2> back;         // (N, 6)
  View<const double, 2> misfit;            // (N, 6)

  CMP_FIELDS(neighbours, back, misfit)
};

// The limits of inks at links (eq. 4: at most one cell of each ink at a marker).
struct LinkInkLimits {
  // of the difference between a neighbour and others of its class; it is of another class if it differs less
  // from a cell of that. Chosen.
  double likeness = 0.5;
  // of the light of cells, between inks that can be told apart. Chosen.
  double least_difference = 0.25;
};

// The limits of a walk.
struct WalkLimits {
  std::int64_t max_rounds = 6;  // walks, each without the cells contradicted before. Chosen.
  // cells around a place without one; beside a straight rim there are two. Derived.
  std::int64_t min_hole_neighbours = 3;
  LinkInkLimits inks;
};

// The cells' places in the lattice; the Python class explains them.
struct Walked {
  Array<std::int32_t, 2> axial;  // (N, 2)
  Array<std::int8_t, 1> first;   // (N,)
  Array<std::int32_t, 1> part;   // (N,)
  std::int64_t contradictions, holes;

  CMP_RECORD("extractor.numbering.lattice_walk.Walk", axial, first, part, contradictions, holes)
};

// Walks over all linked cells, along links that the cells' light (N, 3), NaN unknown, does not contradict.
Walked walk_cells(const CellLinks& links, View<const double, 2> light, const WalkLimits& limits);

}  // namespace cmp::numbering
