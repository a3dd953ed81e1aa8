// The quality of an image, measured at the middles of cells: the properties that limit the reading.
#pragma once

#include "image/pyramid.hpp"

namespace cmp::complete {

// Limits of the quality; explained in extractor/complete/image_quality.py.
struct QualityLimits {
  double clipped_value, dim_quantile;

  template <class F>
  static QualityLimits read(const F& f) {
    return {f["clipped_value"], f["dim_quantile"]};
  }
};

// (K, 2) the means of the markers (M, 2) at the corners (K, 3).
Array<double, 2> centers(View<const double, 2> xy, View<const std::int32_t, 2> corners);

// (5,) contrast, the two inks that differ least, clipping and evenness; NaN where unknown.
//
// The image has no gaps between its rows. center (K, 2) px, NaN where unknown; color (K,) red 0, green 1,
// blue 2, black 3; radius of the averaged patch, px.
Array<double, 1> measure(const image::PyramidLevel& view, View<const double, 2> center,
                         View<const std::uint8_t, 1> color, double radius, const QualityLimits& limits);

}  // namespace cmp::complete
