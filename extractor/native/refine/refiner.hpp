// The end of refinement: the markers in the full image.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "numbering/marker_places.hpp"
#include "refine/estimate.hpp"

namespace cmp::refine {

// Limits of the markers at the full scale.
struct FullScaleLimits {
  // in edges, of the place of a lost marker on which all triangles agree. Chosen.
  double agreed_deviation = numbering::AGREED_DEVIATION;
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
