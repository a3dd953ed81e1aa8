// A local map from the layout to the image: a polynomial of degree 3 with a prior, and how much it must bend.
#pragma once

#include <array>
#include <cmath>

#include "base/array.hpp"
#include "numeric/dense_systems.hpp"

namespace cmp::localmap {

// The prior of a map. Lengths are in edges; a term of degree k has the unit edge per edge^k.
struct MapPrior {
  double noise;      // standard deviation of a point
  double quadratic;  // of the terms of degree 2
  double cubic;      // of the terms of degree 3

  CMP_FIELDS(noise, quadratic, cubic)
};

// Where coordinates of a map begin, and their units.
struct MapFrame {
  double x_mm, y_mm, edge_mm;
  double x_px, y_px, edge_px;
};

// A place in the image, px, and its variance per axis, px^2, by noise and prior.
struct MappedPoint {
  double x, y, variance;
};

class LocalMap {
 public:
  LocalMap(const MapFrame& frame, const MapPrior& prior) : frame_(frame), prior_(prior) {}

  // Adds a known point of the layout and its place in the image.
  void add(double x_mm, double y_mm, double x_px, double y_px) {
    const Terms row = terms(x_mm, y_mm);
    const double x = (x_px - frame_.x_px) / frame_.edge_px, y = (y_px - frame_.y_px) / frame_.edge_px;
    for (Index a = 0; a < TERMS; ++a) {
      for (Index b = 0; b <= a; ++b) normal_[a][b] += row[a] * row[b];
      right_[0][a] += row[a] * x;
      right_[1][a] += row[a] * y;
    }
    squares_ += x * x + y * y;
    ++count_;
  }
  // Fits the map to the points; false where these do not determine a linear map.
  bool solve() {
    if (count_ < FIRST_CURVED) return false;
    factor_ = normal_;
    for (Index a = FIRST_CURVED; a < TERMS; ++a) {
      const double deviation = a < FIRST_CUBIC ? prior_.quadratic : prior_.cubic;
      factor_[a][a] += (prior_.noise / deviation) * (prior_.noise / deviation);
    }
    for (Index a = 0; a < TERMS; ++a) {
      for (Index b = 0; b <= a; ++b) {
        double entry = factor_[a][b];
        for (Index k = 0; k < b; ++k) entry -= factor_[a][k] * factor_[b][k];
        if (a == b && !(entry > LEAST_PIVOT)) return false;
        factor_[a][b] = a == b ? std::sqrt(entry) : entry / factor_[b][b];
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      half_[axis] = lower_solution(right_[axis]);
      solution_[axis] = half_[axis];
      for (Index a = TERMS - 1; a >= 0; --a) {
        for (Index k = a + 1; k < TERMS; ++k) solution_[axis][a] -= factor_[k][a] * solution_[axis][k];
        solution_[axis][a] /= factor_[a][a];
      }
    }
    return true;
  }
  // Squared misfit of the points and of the prior, in variances of noise, over both axes.
  double misfit() const {
    double explained = 0.0;
    for (const Terms& half : half_)
      for (const double value : half) explained += value * value;
    return (squares_ - explained) / (prior_.noise * prior_.noise);
  }
  MappedPoint at(double x_mm, double y_mm) const {
    const Terms row = terms(x_mm, y_mm), half = lower_solution(row);
    double x = 0.0, y = 0.0, leverage = 0.0;
    for (Index a = 0; a < TERMS; ++a) {
      x += row[a] * solution_[0][a];
      y += row[a] * solution_[1][a];
      leverage += half[a] * half[a];
    }
    const double edge = frame_.edge_px;
    return {frame_.x_px + edge * x, frame_.y_px + edge * y,
            edge * edge * prior_.noise * prior_.noise * (1.0 + leverage)};
  }

 private:
  static constexpr Index TERMS = 10, FIRST_CURVED = 3, FIRST_CUBIC = 6;
  static constexpr double LEAST_PIVOT = 1e-6;  // squared edges: points on one line
  using Terms = std::array<double, TERMS>;

  Terms terms(double x_mm, double y_mm) const {
    const double u = (x_mm - frame_.x_mm) / frame_.edge_mm, v = (y_mm - frame_.y_mm) / frame_.edge_mm;
    return {1.0, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v};
  }
  Terms lower_solution(const Terms& right) const {
    Terms out;
    for (Index a = 0; a < TERMS; ++a) {
      out[a] = right[a];
      for (Index k = 0; k < a; ++k) out[a] -= factor_[a][k] * out[k];
      out[a] /= factor_[a][a];
    }
    return out;
  }

  MapFrame frame_;
  MapPrior prior_;
  Index count_ = 0;
  double squares_ = 0.0;
  std::array<Terms, TERMS> normal_{}, factor_{};
  std::array<Terms, 2> right_{}, half_{}, solution_{};
};

}  // namespace cmp::localmap
