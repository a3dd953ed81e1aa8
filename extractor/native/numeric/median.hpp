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

// Moves the numbers from `begin` to `end` for which `is_low` holds to the front; the end of these.
//
// Every number is moved, so that no branch depends on the numbers: a processor guesses every second one
// wrong.
template <class Condition>
double* partition_all(double* begin, double* end, Condition is_low) {
  double* next = begin;
  for (double* at = begin; at < end; ++at) {
    const double value = *at;
    *at = *next;
    *next = value;
    next += is_low(value) ? 1 : 0;
  }
  return next;
}

// The number at place k of the sorted numbers, none of them NaN. Their order is changed: no number before
// place k is larger, none after it is smaller.
inline double select(View<double, 1> values, Index k) {
  constexpr Index FEW = 8;        // numbers left for the library
  constexpr int MAX_ROUNDS = 32;  // of partitions; many rounds are needed by an adverse order only
  double *begin = values.begin(), *end = values.end(), *const place = values.begin() + k;
  for (int round = 0; end - begin > FEW && round < MAX_ROUNDS; ++round) {
    const double first = *begin, middle = begin[(end - begin) / 2], last = end[-1];
    const double pivot = std::max(std::min(first, middle), std::min(std::max(first, middle), last));
    double* const not_less = partition_all(begin, end, [pivot](double value) { return value < pivot; });
    if (place < not_less) {
      end = not_less;
    } else if (not_less > begin) {
      begin = not_less;
    } else {  // the pivot is the least number
      begin = partition_all(begin, end, [pivot](double value) { return value <= pivot; });
      if (place < begin) return pivot;
    }
  }
  std::nth_element(begin, place, end);
  return *place;
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
