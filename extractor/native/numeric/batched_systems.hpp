// Solves many small symmetric systems of equations together, because one alone waits for every root and
// quotient.
//
// `rows` is (R, LANES): a row holds the same number of each system, one system per lane. The lower triangle
// of the matrices begins at row `at`; its entry (a, b) is row `at + packed_index(a, b)`.
#pragma once

#include <cmath>

#include "base/array.hpp"

namespace cmp::numeric {

inline constexpr Index LANES = 16;

// One number of each system.
using LaneRow = std::array<double, LANES>;

// The index of the entry (a, b), b <= a, in a packed lower triangle.
constexpr Index packed_index(Index a, Index b) { return a * (a + 1) / 2 + b; }

// Adds the product of two rows to a row.
inline void add_product(LaneRow& to, const LaneRow& a, const LaneRow& b) {
  LaneRow out = to;  // a copy, which cannot be a or b
  for (Index lane = 0; lane < LANES; ++lane) out[lane] += a[lane] * b[lane];
  to = out;
}

// Subtracts the product of two rows from a row.
inline void subtract_product(LaneRow& to, const LaneRow& a, const LaneRow& b) {
  LaneRow out = to;  // a copy, which cannot be a or b
  for (Index lane = 0; lane < LANES; ++lane) out[lane] -= a[lane] * b[lane];
  to = out;
}

// Divides a row by a row.
inline void divide(LaneRow& to, const LaneRow& by) {
  LaneRow out = to;
  for (Index lane = 0; lane < LANES; ++lane) out[lane] /= by[lane];
  to = out;
}

// Replaces the matrices of `TERMS` equations, packed from `matrix` on, by their Cholesky factors.
//
// A factor with a pivot not above min_pivot is meaningless: `determined` is set to 0 in its lane.
template <Index TERMS>
void update_to_cholesky_factors(LaneRow* matrix, double min_pivot, LaneRow& determined) {
  for (Index i = 0; i < TERMS; ++i) {
    LaneRow& own = matrix[packed_index(i, i)];
    for (Index j = 0; j < i; ++j) {
      LaneRow& entry = matrix[packed_index(i, j)];
      for (Index k = 0; k < j; ++k)
        subtract_product(entry, matrix[packed_index(i, k)], matrix[packed_index(j, k)]);
      divide(entry, matrix[packed_index(j, j)]);
      subtract_product(own, entry, entry);
    }
    LaneRow root = own, large = determined;
    for (Index lane = 0; lane < LANES; ++lane) {
      const bool is_large = own[lane] > min_pivot;
      large[lane] = is_large ? large[lane] : 0.0;
      root[lane] = std::sqrt(is_large ? own[lane] : 1.0);
    }
    own = root;
    determined = large;
  }
}

// Replaces a right side, `TERMS` rows, by the solutions with Cholesky factors.
template <Index TERMS>
void update_to_solutions(const LaneRow* factor, LaneRow* side) {
  for (Index i = 0; i < TERMS; ++i) {
    for (Index k = 0; k < i; ++k) subtract_product(side[i], factor[packed_index(i, k)], side[k]);
    divide(side[i], factor[packed_index(i, i)]);
  }
  for (Index i = TERMS - 1; i >= 0; --i) {
    for (Index k = i + 1; k < TERMS; ++k) subtract_product(side[i], factor[packed_index(k, i)], side[k]);
    divide(side[i], factor[packed_index(i, i)]);
  }
}

}  // namespace cmp::numeric
