// Many short columns of numbers, sorted side by side.
#pragma once

#include <array>
#include <numeric>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// gridlines at a marker and at its neighbours
inline constexpr Index SORT_ROWS = layout::SPOKES * (1 + FIRST_RING);
inline constexpr Index SORT_LANES = 64;  // columns at once

// Numbers in rows; each lane is a column.
class LaneColumn {
 public:
  using Row = std::array<float, SORT_LANES>;

  LaneColumn() { std::iota(places_.begin(), places_.end(), 0); }
  Row& operator[](Index row) { return rows_[places_[row]]; }
  // Sorts each lane by itself. Batcher's odd-even merge sort compares the same rows for any numbers.
  void sort();

 private:
  void update_ordered(Index low, Index high);

  // two rows more: pairs are written there when they are ordered
  std::array<Row, SORT_ROWS + 2> rows_{};
  std::array<Index, SORT_ROWS + 2> places_;
};

}  // namespace cmp::refine
