// The places of cells that were not found, by the cells around.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"
#include "numbering/map_prior.hpp"

namespace cmp::numbering {

// The limits of predicted cells.
struct MissingCellLimits {
  MapPriorLimits prior;  // of the map through the cells around
  // numbered cells that share a corner with a predicted one; with those around them they determine a map.
  // Chosen.
  std::int64_t min_neighbours = 2;
};

// The layout's cells (K,) without a cell of the image that have enough neighbours with one, and their corners
// (K, 3, 2) px, in the layout's order.
//
// centre (N, 2) and cell (N,) of the image's cells; layout, the layout's cells.
std::tuple<Array<std::int32_t, 1>, Array<double, 3>> missing_cells(View<const double, 2> centre,
                                                                   View<const std::int32_t, 1> cell,
                                                                   const layout::LayoutCells& layout,
                                                                   const MissingCellLimits& limits);

}  // namespace cmp::numbering
