// A smooth field of colors over the image, by the colors of some cells.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "base/array.hpp"
#include "numeric/dense_systems.hpp"
#include "numeric/median.hpp"

namespace cmp::numbering {

inline constexpr Index CHANNELS = 3;
using Color = std::array<double, CHANNELS>;

// The limits of a field; those of InkFieldLimits.
struct FieldLimits {
  double residual_scale;
  std::int64_t robust_rounds, quadratic_cells, linear_cells;
};

// A polynomial of degree 2, 1 or 0, by the number of cells; outliers have little weight.
class ColorField {
 public:
  // xy (N, 2) and colors (N,) of all cells; members, the cells of the field.
  ColorField(View<const double, 2> xy, const std::vector<Color>& colors, const std::vector<Index>& members,
             const FieldLimits& limits) {
    const auto count = static_cast<Index>(members.size());
    if (count == 0) return;
    const Index most = count >= limits.quadratic_cells ? TERMS : count >= limits.linear_cells ? LINEAR : 1;
    set_frame(xy, members);
    std::vector<double> weight(members.size(), 1.0), residual(members.size()), sorted;
    // from degree 0 on: a group of outliers at the rim could bend a quadratic field to its color
    for (std::int64_t round = 0; round < limits.robust_rounds; ++round) {
      terms_ = std::min(most, round == 0 ? 1 : round == 1 ? LINEAR : TERMS);
      solve(xy, colors, members, weight);
      for (std::size_t n = 0; n < members.size(); ++n) {
        const Color field = at(xy(members[n], 0), xy(members[n], 1));
        residual[n] = 0.0;
        for (Index c = 0; c < CHANNELS; ++c) residual[n] += std::abs(colors[members[n]][c] - field[c]);
      }
      sorted = residual;
      scatter_ = numeric::median_of_many(View<double, 1>(sorted.data(), {count}));
      for (std::size_t n = 0; n < members.size(); ++n) {
        const double ratio = residual[n] / (limits.residual_scale * scatter_ + 1e-9);
        weight[n] = 1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio));
      }
    }
  }
  // The color at a place; black without cells.
  Color at(double x, double y) const {
    const Terms row = terms(x, y);
    Color out{};
    for (Index k = 0; k < TERMS; ++k)
      for (Index c = 0; c < CHANNELS; ++c) out[c] += row[k] * solution_[k][c];
    return out;
  }
  double scatter() const { return scatter_; }  // the median residual, summed over the channels

 private:
  static constexpr Index TERMS = 6, LINEAR = 3;
  static constexpr double RIDGE = 1e-6;  // of the weight; cells on one line have a solution, too
  using Terms = std::array<double, TERMS>;

  void set_frame(View<const double, 2> xy, const std::vector<Index>& members) {
    const auto count = static_cast<double>(members.size());
    for (const Index i : members) middle_x_ += xy(i, 0) / count, middle_y_ += xy(i, 1) / count;
    double square = 0.0;
    for (const Index i : members) {
      const double x = xy(i, 0) - middle_x_, y = xy(i, 1) - middle_y_;
      square += std::sqrt(x * x + y * y) / count;
    }
    size_ = std::max(square, 1.0);
  }
  Terms terms(double x, double y) const {
    const double u = (x - middle_x_) / size_, v = (y - middle_y_) / size_;
    return {1.0, u, v, u * u, u * v, v * v};
  }
  void solve(View<const double, 2> xy, const std::vector<Color>& colors, const std::vector<Index>& members,
             const std::vector<double>& weight) {
    Array<double, 2> normal({TERMS, TERMS}, 0.0), right({CHANNELS, TERMS}, 0.0);
    for (std::size_t n = 0; n < members.size(); ++n) {
      const Terms row = terms(xy(members[n], 0), xy(members[n], 1));
      for (Index a = 0; a < terms_; ++a) {
        const double weighted = weight[n] * row[a];
        for (Index b = 0; b <= a; ++b) normal(a, b) += weighted * row[b];
        for (Index c = 0; c < CHANNELS; ++c) right(c, a) += weighted * colors[members[n]][c];
      }
    }
    for (Index a = 0; a < terms_; ++a) normal(a, a) += RIDGE * normal(0, 0);
    if (!numeric::update_to_cholesky_solution(normal, right, terms_)) return;
    for (Index c = 0; c < CHANNELS; ++c)
      for (Index k = 0; k < terms_; ++k) solution_[k][c] = right(c, k);
  }

  Index terms_ = 1;
  double middle_x_ = 0.0, middle_y_ = 0.0, size_ = 1.0, scatter_ = 0.0;
  std::array<Color, TERMS> solution_{};  // zero beyond the terms of the degree
};

}  // namespace cmp::numbering
