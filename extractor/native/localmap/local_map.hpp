// A local map from the layout to the image: a polynomial with a prior, and what it says of its own error.
#pragma once

#include <array>
#include <cmath>

#include "base/array.hpp"
#include "numeric/dense_systems.hpp"

namespace cmp::localmap {

// The prior of a map; lengths in edges.
struct MapPrior {
  double noise;      // standard deviation of a cell's center
  double curvature;  // of a second derivative's half, per edge
  double unseen;     // of the terms beyond: of the cube of the distance from the nearest known cell

  template <class F>
  static MapPrior read(const F& f) {
    return {f["noise"], f["curvature"], f["unseen"]};
  }
};

// A place in the image with its variance per axis, px^2, and the slope there, px per mm.
struct MappedPoint {
  double x, y, variance;
  double xx, xy, yx, yy;  // d x / d x_mm, d x / d y_mm, d y / d x_mm, d y / d y_mm
};

// A map of degree 2 about a place of the layout.
class LocalMap {
 public:
  LocalMap(double x_mm, double y_mm, double size_mm, const MapPrior& prior)
      : x_mm_(x_mm), y_mm_(y_mm), size_mm_(size_mm), prior_(prior) {}

  // Adds a known point of the layout and its place in the image.
  void add(double x_mm, double y_mm, double x_px, double y_px) {
    if (count_ == 0) x_px_ = x_px, y_px_ = y_px;
    const Terms row = terms(x_mm, y_mm);
    for (Index a = 0; a < TERMS; ++a) {
      for (Index b = 0; b <= a; ++b) normal_(a, b) += row[a] * row[b];
      right_(0, a) += row[a] * (x_px - x_px_);
      right_(1, a) += row[a] * (y_px - y_px_);
    }
    ++count_;
  }
  // Solves the equations; false where the points do not determine a linear map.
  bool solve() {
    const double ridge = (prior_.noise / prior_.curvature) * (prior_.noise / prior_.curvature);
    for (Index a = FIRST_CURVED; a < TERMS; ++a) normal_(a, a) += ridge;
    if (count_ < FIRST_CURVED) return false;
    Array<double, 2> solution({2, TERMS});
    for (int axis = 0; axis < 2; ++axis)
      for (Index a = 0; a < TERMS; ++a) solution(axis, a) = right_(axis, a);
    factor_ = Array<double, 2>(normal_.view());
    if (!numeric::update_to_cholesky_solution(factor_, solution, TERMS, LEAST_PIVOT)) return false;
    for (int axis = 0; axis < 2; ++axis)
      for (Index a = 0; a < TERMS; ++a) solution_[axis][a] = solution(axis, a);
    return true;
  }
  // The place of a point that is `beyond` edges from the nearest known one.
  MappedPoint at(double x_mm, double y_mm, double beyond) const {
    const Terms row = terms(x_mm, y_mm);
    const double u = row[1], v = row[2];
    MappedPoint out{x_px_, y_px_, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (Index a = 0; a < TERMS; ++a) out.x += row[a] * solution_[0][a], out.y += row[a] * solution_[1][a];
    const auto slope = [&](const Terms& s, double du, double dv) {
      return (du * (s[1] + 2.0 * u * s[3] + v * s[4]) + dv * (s[2] + u * s[4] + 2.0 * v * s[5])) / size_mm_;
    };
    out.xx = slope(solution_[0], 1.0, 0.0), out.xy = slope(solution_[0], 0.0, 1.0);
    out.yx = slope(solution_[1], 1.0, 0.0), out.yy = slope(solution_[1], 0.0, 1.0);
    const double edge2 = std::abs(out.xx * out.yy - out.xy * out.yx) * size_mm_ * size_mm_;
    const double unseen = prior_.unseen * beyond * beyond * beyond;
    out.variance = edge2 * (prior_.noise * prior_.noise * (1.0 + leverage(row)) + unseen * unseen);
    return out;
  }

 private:
  static constexpr Index TERMS = 6, FIRST_CURVED = 3;
  static constexpr double LEAST_PIVOT = 1e-2;  // cells, on one line to a tenth of an edge
  using Terms = std::array<double, TERMS>;

  Terms terms(double x_mm, double y_mm) const {
    const double u = (x_mm - x_mm_) / size_mm_, v = (y_mm - y_mm_) / size_mm_;
    return {1.0, u, v, u * u, u * v, v * v};
  }
  // The variance of the map at a row of terms over that of one point.
  double leverage(const Terms& row) const {
    double sum = 0.0;
    Terms z;
    for (Index a = 0; a < TERMS; ++a) {
      z[a] = row[a];
      for (Index b = 0; b < a; ++b) z[a] -= factor_(a, b) * z[b];
      z[a] /= factor_(a, a);
      sum += z[a] * z[a];
    }
    return sum;
  }

  double x_mm_, y_mm_, size_mm_;
  MapPrior prior_;
  double x_px_ = 0.0, y_px_ = 0.0;
  Index count_ = 0;
  Array<double, 2> normal_{{TERMS, TERMS}, 0.0}, right_{{2, TERMS}, 0.0}, factor_;
  std::array<Terms, 2> solution_{};
};

}  // namespace cmp::localmap
