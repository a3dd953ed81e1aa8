#include "complete/layer_arcs.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "numeric/dense_systems.hpp"

namespace cmp::complete {

namespace {

constexpr Index SEXTANTS = 6;
constexpr Index TERMS = 3;  // of the quadratic: 1, s, s^2, with s from -1 to 1 along the sextant
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

using Ids = View<const Index, 1>;

// The quadratics of x and y through the known markers of a sextant of a layer.
class LayerQuadratic {
 public:
  LayerQuadratic(View<const double, 2> xy, Ids ids) : xy_(xy), ids_(ids), last_(ids.size() - 1) {
    for (Index k = 0; k <= last_; ++k) {
      if (!is_known(k)) continue;
      begin_ = begin_ < 0 ? k : begin_;
      end_ = k;
      ++count_;
      add(k);
    }
  }

  void solve() {
    auto gram = normal_;
    numeric::update_to_cholesky_solution(View<double, 2>(gram.data(), {TERMS, TERMS}),
                                         View<double, 2>(terms_.data(), {2, TERMS}), TERMS);
  }

  // writes places and variances of the unknown markers between known ones, where the variance is smaller
  void update(View<double, 2> predicted, View<double, 1> variance) const {
    const double residual = mean_square();
    for (Index k = begin_; k <= end_; ++k) {
      if (is_known(k)) continue;
      const double s = place(k), own_variance = residual * variance_factor(s);
      const Index m = ids_[k];
      if (!(own_variance < variance[m])) continue;
      variance[m] = own_variance;
      for (Index axis = 0; axis < 2; ++axis) predicted(m, axis) = term(axis, 0) + s * rising_part(axis, s);
    }
  }

 private:
  double place(Index k) const { return 2.0 * static_cast<double>(k) / static_cast<double>(last_) - 1.0; }
  bool is_known(Index k) const { return !std::isnan(xy_(ids_[k], 0)); }
  double term(Index axis, Index k) const { return terms_[axis * TERMS + k]; }
  double rising_part(Index axis, double s) const { return term(axis, 1) + s * term(axis, 2); }

  void add(Index k) {
    const double s = place(k);
    const std::array<double, TERMS> row{1.0, s, s * s};
    for (Index a = 0; a < TERMS; ++a) {
      for (Index b = 0; b < TERMS; ++b) normal_[a * TERMS + b] += row[a] * row[b];
      for (Index axis = 0; axis < 2; ++axis) terms_[axis * TERMS + a] += row[a] * xy_(ids_[k], axis);
    }
  }

  // of the residuals, per axis
  double mean_square() const {
    double squares = 0.0;
    for (Index k = begin_; k <= end_; ++k) {
      if (!is_known(k)) continue;
      const double s = place(k);
      for (Index axis = 0; axis < 2; ++axis) {
        const double left = xy_(ids_[k], axis) - term(axis, 0), misfit = left - s * rising_part(axis, s);
        squares += misfit * misfit;
      }
    }
    return squares / (2.0 * static_cast<double>(count_ - TERMS));
  }

  // from the variance of a marker to that of its difference from the quadratic at s
  double variance_factor(double s) const {
    auto gram = normal_;
    std::array<double, TERMS> unit{1.0, s, s * s};
    numeric::update_to_cholesky_solution(View<double, 2>(gram.data(), {TERMS, TERMS}),
                                         View<double, 2>(unit.data(), {1, TERMS}), TERMS);
    return 1.0 + unit[0] + s * (unit[1] + s * unit[2]);
  }

  View<const double, 2> xy_;
  Ids ids_;
  Index last_, count_ = 0, begin_ = -1, end_ = -1;
  std::array<double, TERMS * TERMS> normal_{};
  std::array<double, 2 * TERMS> terms_{};  // right sides at first
};

}  // namespace

LayerPrediction predict_by_layer(View<const double, 2> xy, Index layers, const LayerLimits& limits) {
  Array<double, 2> predicted(xy.shape(), NOT_A_NUMBER);
  Array<double, 1> variance({xy.size()}, std::numeric_limits<double>::infinity());
  Array<Index, 1> buffer({layers + 1});
  for (Index layer = 1; layer <= layers; ++layer) {
    const Index first = 3 * layer * (layer - 1) + 1, count = SEXTANTS * layer;
    const auto ids = buffer.slice(0, layer + 1);
    for (Index sextant = 0; sextant < SEXTANTS; ++sextant) {
      Index unknown = 0;
      for (Index k = 0; k <= layer; ++k) {
        ids[k] = first + (sextant * layer + k) % count;
        unknown += std::isnan(xy(ids[k], 0)) ? 1 : 0;
      }
      if (unknown == 0 || layer + 1 - unknown < limits.min_markers) continue;
      LayerQuadratic quadratic(xy, ids);
      quadratic.solve();
      quadratic.update(predicted, variance);
    }
  }
  return {std::move(predicted), std::move(variance)};
}

}  // namespace cmp::complete
