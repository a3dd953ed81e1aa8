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

// A sum of squares, px^2, and its degrees of freedom.
struct Squares {
  double sum = 0.0, freedom = 0.0;

  void add(const Squares& other) {
    sum += other.sum;
    freedom += other.freedom;
  }
  // per degree of freedom, together with the mean of others, which counts as so many degrees of freedom
  double mean_with(const Squares& others, double count) const {
    return (sum + count * others.sum / others.freedom) / (freedom + count);
  }
};

// How the errors of known markers move a place on a quadratic: the factor of a variance that all have, and
// the variance by their own, px^2.
struct Influence {
  double leverage, noise;
};

// The quadratics of x and y through the known markers of a sextant of a layer.
class LayerQuadratic {
 public:
  LayerQuadratic(View<const double, 2> xy, View<const double, 1> noise, Ids ids)
      : xy_(xy), noise_(noise), ids_(ids), last_(ids.size() - 1) {
    for (Index k = 0; k <= last_; ++k) {
      if (!is_known(k)) continue;
      begin_ = begin_ < 0 ? k : begin_;
      end_ = k;
      ++count_;
      add(k);
    }
    auto gram = normal_;
    numeric::update_to_cholesky_solution(View<double, 2>(gram.data(), {TERMS, TERMS}),
                                         View<double, 2>(terms_.data(), {2, TERMS}), TERMS);
  }

  // the residuals of both axes
  Squares residuals() const {
    Squares out{0.0, 2.0 * static_cast<double>(count_ - TERMS)};
    for (Index k = begin_; k <= end_; ++k) {
      if (!is_known(k)) continue;
      const double s = place(k);
      for (Index axis = 0; axis < 2; ++axis) {
        const double left = xy_(ids_[k], axis) - term(axis, 0), misfit = left - s * rising_part(axis, s);
        out.sum += misfit * misfit;
      }
    }
    return out;
  }

  // Writes the places of the unknown markers between known ones into `out` where the misfit is smaller.
  //
  // residual: variance of the markers about quadratics, px^2.
  void update(double residual, LayerPrediction& out) const {
    const Squares own = residuals();
    const double own_residual = own.sum / own.freedom;
    for (Index k = begin_; k <= end_; ++k) {
      if (is_known(k)) continue;
      const double s = place(k);
      const Influence influence = influence_at(s);
      const double misfit = own_residual * (1.0 + influence.leverage);
      const Index m = ids_[k];
      if (!(misfit < out.misfit_px2[m])) continue;
      out.misfit_px2[m] = misfit;
      out.variance_px2[m] = residual * (1.0 + influence.leverage) + influence.noise;
      for (Index axis = 0; axis < 2; ++axis) out.xy_px(m, axis) = term(axis, 0) + s * rising_part(axis, s);
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

  // of the known markers on the quadratic at s
  Influence influence_at(double s) const {
    auto gram = normal_;
    std::array<double, TERMS> unit{1.0, s, s * s};
    numeric::update_to_cholesky_solution(View<double, 2>(gram.data(), {TERMS, TERMS}),
                                         View<double, 2>(unit.data(), {1, TERMS}), TERMS);
    const auto weight_of = [&unit](double at) { return unit[0] + at * (unit[1] + at * unit[2]); };
    Influence out{weight_of(s), 0.0};
    for (Index k = begin_; k <= end_; ++k) {
      if (!is_known(k)) continue;
      const double weight = weight_of(place(k));
      out.noise += weight * weight * noise_[ids_[k]];
    }
    return out;
  }

  View<const double, 2> xy_;
  View<const double, 1> noise_;
  Ids ids_;
  Index last_, count_ = 0, begin_ = -1, end_ = -1;
  std::array<double, TERMS * TERMS> normal_{};
  std::array<double, 2 * TERMS> terms_{};  // right sides at first
};

// Calls visit(quadratic, unknown) for every sextant of every layer with enough known markers; unknown: how
// many are not.
template <class Visit>
void for_quadratics(View<const double, 2> xy, View<const double, 1> noise, Index layers,
                    const LayerLimits& limits, Visit visit) {
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
      if (layer + 1 - unknown >= limits.min_markers) visit(LayerQuadratic(xy, noise, ids), unknown);
    }
  }
}

}  // namespace

LayerPrediction predict_by_layer(View<const double, 2> xy, View<const double, 1> noise_px2, Index layers,
                                 const LayerLimits& limits) {
  constexpr double NONE = std::numeric_limits<double>::infinity();
  LayerPrediction out{Array<double, 2>(xy.shape(), NOT_A_NUMBER), Array<double, 1>({xy.size()}, NONE),
                      Array<double, 1>({xy.size()}, NONE)};
  Squares all;
  for_quadratics(xy, noise_px2, layers, limits,
                 [&](const LayerQuadratic& quadratic, Index) { all.add(quadratic.residuals()); });
  for_quadratics(xy, noise_px2, layers, limits, [&](const LayerQuadratic& quadratic, Index unknown) {
    if (unknown == 0) return;
    quadratic.update(quadratic.residuals().mean_with(all, limits.picture_freedom), out);
  });
  return out;
}

}  // namespace cmp::complete
