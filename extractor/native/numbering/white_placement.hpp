// Places the known cells in the layout as if a certain down-cell were the white cell.
#pragma once

#include "base/array.hpp"

namespace cmp::numbering {

// The known cells by their axial places.
class PlacedCells {
 public:
  // center (N, 2) px; axial (N, 2); known (K,); cell_lookup (S, S) of the lattice
  PlacedCells(View<const double, 2> center, View<const std::int32_t, 2> axial,
              View<const std::int64_t, 1> known, View<const std::int32_t, 2> cell_lookup);

  // Numbers the known cells as if the down-cell at an axial place (2,) were the white cell.
  //
  // cell (N,) receives the layout's cells, or -1. How many known cells lie in the layout.
  Index fill_placement(View<const std::int32_t, 1> place, View<std::int32_t, 1> cell) const;

  // How often a neighbour of a known cell lies in the layout and in the image, but is not known.
  //
  // Its center is extrapolated from the cell and the one opposite; it counts a step away from the image's
  // border. place (2,) of the white cell; width and height of the image, px.
  Index count_missing(View<const std::int32_t, 1> place, double width, double height) const;

 private:
  std::int32_t cell_at_place(Index q, Index r, View<const std::int32_t, 1> place) const;

  View<const double, 2> center_;
  View<const std::int32_t, 2> axial_;
  View<const std::int64_t, 1> known_;
  View<const std::int32_t, 2> cell_lookup_;
  Index first_q_, first_r_;
  Array<std::int32_t, 2>
      walked_;  // the known cell at each axial place relative to the first, or -1; with a rim of -1
};

}  // namespace cmp::numbering
