// Heavy omission (the article's Fig. 8): a quadratic through the markers of one layer within a sextant.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::complete {

// Limits of these quadratics; explained in extractor/complete/layer_arcs.py.
struct LayerLimits {
  std::int64_t min_markers;

  template <class F>
  static LayerLimits read(const F& f) {
    return {f["min_markers"]};
  }
};

using LayerPrediction = std::tuple<Array<double, 2>, Array<double, 1>>;

// Places of the unknown markers between known ones, on the quadratic through their layer and sextant.
//
// xy (M, 2) px, NaN where unknown. (M, 2) px, NaN where there are too few markers; and (M,) the variance of
// these places, px^2 per axis, from the residual of the fit, infinite without a place. For a corner of the
// layer, which two sextants share, the place with the smaller variance is taken.
LayerPrediction predict_by_layer(View<const double, 2> xy, Index layers, const LayerLimits& limits);

}  // namespace cmp::complete
