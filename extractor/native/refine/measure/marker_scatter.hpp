// The scatter of the markers: how far each lies off a smooth map by itself.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"

namespace cmp::refine {

// Independent scatter of the markers of a picture, each by itself.
struct MarkerScatter {
  double variance;  // px^2, one axis
  double share;     // 0 to 1, of the variance of the fourth differences

  template <class F>
  static MarkerScatter read(const F& f) {
    return {f["variance_px2"], f["share"]};
  }

  // px^2, the variance of a gridline's b; bending (3,), the gridline's scatter_bending of the topology
  double bend_variance(View<const double, 1> bending) const {
    const double tangents = 1.0 - share;
    return variance * (tangents * tangents * bending[0] + 2.0 * tangents * share * bending[1] +
                       share * share * bending[2]);
  }
};

// Limits of scatter; explained in extractor/refine/measure/marker_scatter.py.
struct ScatterLimits {
  double smooth_ratio, noise_allowance, quantile;

  template <class F>
  static ScatterLimits read(const F& f) {
    return {f["smooth_ratio"], f["noise_allowance"], f["quantile"]};
  }
};

// variance and share of MarkerScatter.
using ScatterFigures = std::tuple<double, double>;

// The scatter, from the third and fourth differences of the markers along their gridlines.
//
// xy (M, 2) px, NaN where unknown; maps (M, 2, 5), as local_maps gives them; diagonal (M, 3) 1/px^2, the
// information's diagonal blocks.
ScatterFigures measure_scatter(View<const double, 2> xy, View<const double, 3> maps,
                               View<const double, 2> diagonal, const layout::Topology& topology,
                               const ScatterLimits& limits);

}  // namespace cmp::refine
