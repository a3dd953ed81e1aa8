// The end of refinement: the markers in the full image.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "refine/estimate.hpp"

namespace cmp::refine {

// Limits of the markers at the full scale; explained in extractor/refine/refiner.py.
struct FullScaleLimits {
  double agreed_deviation;

  template <class F>
  static FullScaleLimits read(const F& f) {
    return {f["agreed_deviation"]};
  }
};

// Markers (M, 2) px and covariances (M, 2, 2) px^2 in the full image; a lost one lies where its triangles
// agree.
//
// xy, cov and places in an image reduced by `scale`.
std::tuple<Array<double, 2>, Array<double, 3>> at_full_scale(View<const double, 2> xy,
                                                             View<const double, 3> cov,
                                                             const StartPlaces& places, double scale,
                                                             const FullScaleLimits& limits);

}  // namespace cmp::refine
