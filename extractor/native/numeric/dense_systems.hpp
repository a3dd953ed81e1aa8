// Small vectors and dense systems of equations.
#pragma once

#include <cmath>
#include <limits>

#include "base/array.hpp"

namespace cmp::numeric {

// The scalar product of two vectors (3,).
inline double dot3(View<const double, 1> a, View<const double, 1> b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Replaces the rows of `right` (R, n) by the solutions x of gram x = row. Where a squared pivot is not above
// `min_pivot`, false, and the solutions are NaN.
//
// gram (n, n), n >= count, symmetric and positive definite; the lower triangle of its first `count` rows is
// read, and replaced by the Cholesky factor.
inline bool update_to_cholesky_solution(View<double, 2> gram, View<double, 2> right, Index count,
                                        double min_pivot = 0.0) {
  for (Index j = 0; j < count; ++j) {
    double pivot = gram(j, j);
    for (Index k = 0; k < j; ++k) pivot -= gram(j, k) * gram(j, k);
    if (!(pivot > min_pivot)) {
      right.fill(std::numeric_limits<double>::quiet_NaN());
      return false;
    }
    pivot = std::sqrt(pivot);
    gram(j, j) = pivot;
    for (Index i = j + 1; i < count; ++i) {
      double entry = gram(i, j);
      for (Index k = 0; k < j; ++k) entry -= gram(i, k) * gram(j, k);
      gram(i, j) = entry / pivot;
    }
  }
  for (Index row = 0; row < right.size(); ++row) {
    const auto x = right[row];
    for (Index j = 0; j < count; ++j) {
      double value = x[j];
      for (Index k = 0; k < j; ++k) value -= gram(j, k) * x[k];
      x[j] = value / gram(j, j);
    }
    for (Index j = count - 1; j >= 0; --j) {
      double value = x[j];
      for (Index k = j + 1; k < count; ++k) value -= gram(k, j) * x[k];
      x[j] = value / gram(j, j);
    }
  }
  return true;
}

}  // namespace cmp::numeric
