// A local map from the layout to the image: a polynomial of degree 1 to 3, by least squares with a prior.
#pragma once

#include <array>
#include <cmath>

#include "base/array.hpp"

namespace cmp::localmap {

// Where coordinates of a map begin, and their units.
struct MapFrame {
  double x_mm, y_mm, edge_mm;
  double x_px, y_px, edge_px;
};

// The prior: what is added to the diagonal of the normal equations for the terms 1; u^2 and v^2; u v; all of
// degree 3. It is the variance of a point of weight 1 over that of the term.
struct MapRidge {
  double constant = 0.0, square = 0.0, mixed = 0.0, cubic = 0.0;
};

inline constexpr double RIGID = 1e12;  // a ridge that holds a term at 0

template <int DEGREE>
class LocalMap {
 public:
  static constexpr Index TERMS = (DEGREE + 1) * (DEGREE + 2) / 2;
  using Terms = std::array<double, TERMS>;

  explicit LocalMap(const MapFrame& frame) : frame_(frame) {}

  // 1, u, v, and so on, of a place in the layout
  Terms terms(double x_mm, double y_mm) const {
    const double u = (x_mm - frame_.x_mm) / frame_.edge_mm, v = (y_mm - frame_.y_mm) / frame_.edge_mm;
    if constexpr (DEGREE == 1)
      return {1.0, u, v};
    else if constexpr (DEGREE == 2)
      return {1.0, u, v, u * u, u * v, v * v};
    else
      return {1.0, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v};
  }

  // Adds a point of the layout at its place in the image.
  void add(double x_mm, double y_mm, double x_px, double y_px, double weight = 1.0) {
    const Terms row = terms(x_mm, y_mm);
    const double x = (x_px - frame_.x_px) / frame_.edge_px, y = (y_px - frame_.y_px) / frame_.edge_px;
    for (Index a = 0; a < TERMS; ++a) {
      const double weighted = weight * row[a];
      for (Index b = 0; b <= a; ++b) normal_[a][b] += weighted * row[b];
      right_[0][a] += weighted * x;
      right_[1][a] += weighted * y;
    }
    squares_ += weight * (x * x + y * y);
  }

  // Fits the map to the points; false where these and the prior do not determine it, or where the points lie
  // on one line: min_spread, the least ratio of their spread across to that along.
  bool solve(const MapRidge& ridge, double min_spread) {
    factor_ = normal_;
    for (Index a = 0; a < TERMS; ++a) {
      if (a < 1)
        factor_[a][a] += ridge.constant;
      else if (a >= FIRST_CURVED)
        factor_[a][a] += a >= FIRST_CUBIC ? ridge.cubic : a == MIXED ? ridge.mixed : ridge.square;
    }
    for (Index a = 0; a < TERMS; ++a) {
      for (Index b = 0; b < a; ++b) {
        double entry = factor_[a][b];
        for (Index k = 0; k < b; ++k) entry -= factor_[a][k] * factor_[b][k];
        factor_[a][b] = entry / factor_[b][b];
      }
      double pivot = factor_[a][a];
      for (Index k = 0; k < a; ++k) pivot -= factor_[a][k] * factor_[a][k];
      if (a == 2) {  // the determinant of the points' scatter about their middle, against a round one
        const double along = factor_[1][1] * factor_[1][1];
        const double spread = 0.5 * min_spread * (along + pivot + factor_[2][1] * factor_[2][1]);
        if (!(along * pivot > spread * spread)) return false;
      }
      if (!(pivot > MIN_PIVOT)) return false;
      factor_[a][a] = std::sqrt(pivot);
    }
    for (int axis = 0; axis < 2; ++axis) {
      half_[axis] = lower_solution(right_[axis]);
      coefficients_[axis] = upper_solution(half_[axis]);
    }
    return true;
  }

  // The squared misfit of the points and of the prior, over both axes, in squared edges.
  double misfit() const {
    double explained = 0.0;
    for (const Terms& half : half_)
      for (const double value : half) explained += value * value;
    return squares_ - explained;
  }
  // The coefficients of the terms along an axis of the image, in edges.
  const Terms& coefficients(int axis) const { return coefficients_[axis]; }
  // The place in the image, px.
  std::array<double, 2> at(double x_mm, double y_mm) const {
    const Terms row = terms(x_mm, y_mm);
    return {frame_.x_px + frame_.edge_px * product(row, coefficients_[0]),
            frame_.y_px + frame_.edge_px * product(row, coefficients_[1])};
  }
  // How points move the map at a place: one of weight 1, whose terms are r, by the product with r.
  Terms influence(double x_mm, double y_mm) const {
    return upper_solution(lower_solution(terms(x_mm, y_mm)));
  }
  // The variance of the map at a place, over that of a point of weight 1.
  double leverage(double x_mm, double y_mm) const {
    const Terms half = lower_solution(terms(x_mm, y_mm));
    return product(half, half);
  }
  static double product(const Terms& a, const Terms& b) {
    double sum = 0.0;
    for (Index k = 0; k < TERMS; ++k) sum += a[k] * b[k];
    return sum;
  }

 private:
  static constexpr Index FIRST_CURVED = 3, MIXED = 4, FIRST_CUBIC = 6;
  static constexpr double MIN_PIVOT = 1e-7;  // squared edges

  Terms lower_solution(Terms x) const {
    for (Index a = 0; a < TERMS; ++a) {
      for (Index k = 0; k < a; ++k) x[a] -= factor_[a][k] * x[k];
      x[a] /= factor_[a][a];
    }
    return x;
  }
  Terms upper_solution(Terms x) const {
    for (Index a = TERMS - 1; a >= 0; --a) {
      for (Index k = a + 1; k < TERMS; ++k) x[a] -= factor_[k][a] * x[k];
      x[a] /= factor_[a][a];
    }
    return x;
  }

  MapFrame frame_;
  double squares_ = 0.0;
  std::array<Terms, TERMS> normal_{}, factor_{};
  std::array<Terms, 2> right_{}, half_{}, coefficients_{};
};

}  // namespace cmp::localmap
