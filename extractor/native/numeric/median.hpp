// Medians, of a few numbers and of many.
#pragma once

#include <algorithm>
#include <limits>

#include "base/array.hpp"

namespace cmp::numeric {

// The median of the first `count` values, at least one and none of them NaN.
//
// Sorting takes an unpredictable branch per comparison; counting the smaller numbers of each takes none.
inline double median_of(View<const double, 1> values, Index count) {
  constexpr double LEAST = -std::numeric_limits<double>::infinity();
  double low = LEAST, high = LEAST;
  for (Index i = 0; i < count; ++i) {
    const double own = values[i];
    Index smaller = 0;
    for (Index j = 0; j < count; ++j) smaller += values[j] < own;
    const double low_own = smaller <= (count - 1) / 2 ? own : LEAST;
    const double high_own = smaller <= count / 2 ? own : LEAST;
    low = std::max(low, low_own);
    high = std::max(high, high_own);
  }
  return 0.5 * (low + high);
}

// The number at place k of the sorted numbers, none of them NaN; their order is changed.
inline double select(View<double, 1> values, Index k) {
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[k];
}

// The median of many numbers, none of them NaN; NaN without any. Their order is changed.
inline double median_of_many(View<double, 1> values) {
  if (values.size() == 0) return std::numeric_limits<double>::quiet_NaN();
  const Index half = values.size() / 2;
  const double upper = select(values, half);
  if (values.size() % 2 != 0) return upper;
  return (*std::max_element(values.begin(), values.begin() + half) + upper) / 2;
}

}  // namespace cmp::numeric
