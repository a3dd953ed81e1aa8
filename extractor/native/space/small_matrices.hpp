// Matrices whose sizes are known, and the eigenvalues and the inverse of symmetric 3 x 3 ones.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/array.hpp"

namespace cmp::space {

inline constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
inline constexpr double INFINITE = std::numeric_limits<double>::infinity();

template <int R, int C>
struct Matrix {
  std::array<double, static_cast<std::size_t>(R) * C> values{};

  double& operator()(int row, int column) { return values[static_cast<std::size_t>(row * C + column)]; }
  double operator()(int row, int column) const { return values[static_cast<std::size_t>(row * C + column)]; }
  double& operator[](int k) { return values[static_cast<std::size_t>(k)]; }
  double operator[](int k) const { return values[static_cast<std::size_t>(k)]; }

  static Matrix filled(double value) {
    Matrix out;
    out.values.fill(value);
    return out;
  }
  static Matrix unit() {
    Matrix out;
    for (int k = 0; k < std::min(R, C); ++k) out(k, k) = 1.0;
    return out;
  }
  static Matrix copied(View<const double, C == 1 ? 1 : 2> from) {
    Matrix out;
    if constexpr (C == 1) {
      std::copy_n(from.begin(), R, out.values.begin());
    } else {
      for (int i = 0; i < R; ++i) std::copy_n(from[i].begin(), C, out.values.begin() + i * C);
    }
    return out;
  }
  void copy_to(View<double, C == 1 ? 1 : 2> to) const {
    if constexpr (C == 1) {
      std::copy_n(values.begin(), R, to.begin());
    } else {
      for (int i = 0; i < R; ++i) std::copy_n(values.begin() + i * C, C, to[i].begin());
    }
  }
  bool is_finite() const {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  }
  Matrix<C, R> transposed() const {
    Matrix<C, R> out;
    for (int i = 0; i < R; ++i)
      for (int j = 0; j < C; ++j) out(j, i) = (*this)(i, j);
    return out;
  }
  Matrix& operator+=(const Matrix& other) {
    for (std::size_t k = 0; k < values.size(); ++k) values[k] += other.values[k];
    return *this;
  }
  Matrix& operator*=(double factor) {
    for (double& value : values) value *= factor;
    return *this;
  }
};

template <int N>
using Vector = Matrix<N, 1>;

template <int R, int K, int C>
Matrix<R, C> operator*(const Matrix<R, K>& one, const Matrix<K, C>& other) {
  Matrix<R, C> out;
  for (int i = 0; i < R; ++i)
    for (int k = 0; k < K; ++k)
      for (int j = 0; j < C; ++j) out(i, j) += one(i, k) * other(k, j);
  return out;
}
template <int R, int C>
Matrix<R, C> operator*(double factor, Matrix<R, C> matrix) {
  return matrix *= factor;
}
template <int R, int C>
Matrix<R, C> operator+(Matrix<R, C> one, const Matrix<R, C>& other) {
  return one += other;
}
template <int R, int C>
Matrix<R, C> operator-(const Matrix<R, C>& one, const Matrix<R, C>& other) {
  return one + -1.0 * other;
}
template <int N>
double dot(const Vector<N>& one, const Vector<N>& other) {
  double sum = 0.0;
  for (int k = 0; k < N; ++k) sum += one[k] * other[k];
  return sum;
}

// The matrix [v]x: [v]x w is the cross product of v and w.
inline Matrix<3, 3> cross_matrix(const Vector<3>& v) {
  return {{0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0}};
}

// The eigenvalues of a symmetric matrix by Jacobi's rotations, the least one first.
inline std::array<double, 3> eigenvalues(Matrix<3, 3> m) {
  constexpr int MAX_SWEEPS = 30;
  for (int sweep = 0; sweep < MAX_SWEEPS; ++sweep) {
    const double beside = std::abs(m(0, 1)) + std::abs(m(0, 2)) + std::abs(m(1, 2));
    if (!(beside > 0.0)) break;
    for (const auto [p, q] : {std::array{0, 1}, std::array{0, 2}, std::array{1, 2}}) {
      if (m(p, q) == 0.0) continue;
      const double theta = 0.5 * (m(q, q) - m(p, p)) / m(p, q);
      const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::hypot(theta, 1.0));
      const double c = 1.0 / std::hypot(t, 1.0), s = t * c;
      const int r = 3 - p - q;
      const double pq = m(p, q), pr = m(p, r), qr = m(q, r);
      m(p, p) -= t * pq;
      m(q, q) += t * pq;
      m(p, q) = m(q, p) = 0.0;
      m(p, r) = m(r, p) = c * pr - s * qr;
      m(q, r) = m(r, q) = s * pr + c * qr;
    }
  }
  std::array<double, 3> found{m(0, 0), m(1, 1), m(2, 2)};
  std::sort(found.begin(), found.end());
  return found;
}

inline double determinant(const Matrix<3, 3>& m) {
  return m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) -
         m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0)) +
         m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0));
}

// Whether the least eigenvalue of a symmetric matrix with none below 0 is above a limit. The others multiply
// to at most the square of half the trace; only where that does not decide, the eigenvalues are computed.
inline bool is_regular(const Matrix<3, 3>& m, double min_eigenvalue) {
  constexpr double MARGIN = 10.0;
  const double half = 0.5 * (m(0, 0) + m(1, 1) + m(2, 2));
  return determinant(m) > MARGIN * min_eigenvalue * half * half || eigenvalues(m)[0] > min_eigenvalue;
}

// The inverse of a symmetric matrix in its own scale; infinite variances where it is singular.
inline Matrix<3, 3> scaled_inverse(const Matrix<3, 3>& normal, double min_eigenvalue) {
  Matrix<3, 3> singular;
  for (int k = 0; k < 3; ++k) singular(k, k) = INFINITE;
  if (!normal.is_finite() || !(normal(0, 0) > 0.0 && normal(1, 1) > 0.0 && normal(2, 2) > 0.0))
    return singular;
  const double root[3] = {std::sqrt(normal(0, 0)), std::sqrt(normal(1, 1)), std::sqrt(normal(2, 2))};
  Matrix<3, 3> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = normal(i, j) / (root[i] * root[j]);
  if (!is_regular(m, min_eigenvalue)) return singular;
  Matrix<3, 3> out;  // by cofactors
  for (int i = 0; i < 3; ++i) {
    const int a = (i + 1) % 3, b = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int c = (j + 1) % 3, d = (j + 2) % 3;
      out(j, i) = m(a, c) * m(b, d) - m(a, d) * m(b, c);
    }
  }
  const double volume = m(0, 0) * out(0, 0) + m(0, 1) * out(1, 0) + m(0, 2) * out(2, 0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out(i, j) /= volume * root[i] * root[j];
  return out;
}

}  // namespace cmp::space
