#include "refine/measure/lane_sort.hpp"

#include <utility>

namespace cmp::refine {

namespace {

constexpr Index SPARE = SORT_ROWS;

void fill_ordered(const LaneColumn::Row& one, const LaneColumn::Row& other, LaneColumn::Row& less,
                  LaneColumn::Row& more) {
  for (std::size_t k = 0; k < SORT_LANES; ++k) {
    less[k] = std::min(one[k], other[k]);
    more[k] = std::max(one[k], other[k]);
  }
}

}  // namespace

void LaneColumn::update_ordered(Index low, Index high) {
  fill_ordered((*this)[low], (*this)[high], (*this)[SPARE], (*this)[SPARE + 1]);
  std::swap(places_[low], places_[SPARE]);
  std::swap(places_[high], places_[SPARE + 1]);
}

void LaneColumn::sort() {
  for (Index size = 1; size < SORT_ROWS; size *= 2) {
    for (Index step = size; step >= 1; step /= 2) {
      for (Index low = step % size; low < SORT_ROWS - step; low += 2 * step) {
        if (low / (2 * size) != (low + step) / (2 * size)) continue;
        const Index end = std::min(low + step, SORT_ROWS - step);
        for (Index row = low; row < end; ++row) update_ordered(row, row + step);
      }
    }
  }
}

}  // namespace cmp::refine
