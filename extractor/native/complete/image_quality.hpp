// The quality of an image, measured at the middles of cells: the properties that limit the reading.
#pragma once

#include <tuple>

#include "image/input.hpp"
#include "image/pyramid.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::complete {

// Limits of the quality; explained in extractor/complete/image_quality.py.
struct QualityLimits {
  double clipped_value, dim_quantile, sample_radius;
  image::NoiseLimits noise;
  refine::GridlineWeightLimits gridlines;

  template <class F>
  static QualityLimits read(const F& f) {
    return {f["clipped_value"], f["dim_quantile"], f["sample_radius"], f["noise"], f["gridlines"]};
  }
};

// The cells of a layout at which the quality is measured.
struct SampledCells {
  View<const std::int32_t, 2> corners;  // (K, 3) marker ids
  View<const std::uint8_t, 1> color;    // (K,) red 0, green 1, blue 2, black 3

  template <class F>
  static SampledCells read(const F& f) {
    return {f["corners"], f["color"]};
  }
};

// The fields of CellFigures.
using CellFigures = std::tuple<double, Index, Index, double, double>;

// The figures of numbered markers (M, 2) px, NaN where lost; the noise, and the median length of the edges
// (E, 2).
std::tuple<CellFigures, double, double> measure_numbered(const image::PyramidLevel& view,
                                                         const SampledCells& cells, View<const double, 2> xy,
                                                         View<const std::int32_t, 2> edges,
                                                         const QualityLimits& limits);

}  // namespace cmp::complete
