// The quality of an image, measured at the middles of cells: the properties that limit the reading.
#pragma once

#include <tuple>

#include "image/input.hpp"
#include "image/pyramid.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::complete {

// Limits of the quality.
struct QualityLimits {
  // of 255, from which on a cell's mean is clipped; noise pulls it below 255. Chosen.
  double clipped_value = 253.0;
  double dim_quantile = 0.05;  // of the cells' light, that is the dimmest; the brightest are as many. Chosen.
  double sample_radius = 0.08;  // in edges, over which a cell's color is averaged. Chosen.
  image::NoiseLimits noise;
  refine::GridlineWeightLimits gridlines;
};

// The cells of a layout at which the quality is measured.
struct SampledCells {
  View<const std::int32_t, 2> corners;  // (K, 3) marker ids
  View<const std::uint8_t, 1> color;    // (K,) red 0, green 1, blue 2, black 3

  CMP_RECORD("extractor.complete.image_quality.SampledCells", corners, color)
};

// The figures at the middles of cells; contrast, clipping and evenness are NaN where no cell was measured.
struct CellFigures {
  double contrast;
  Index one, other;  // the two inks that differ least
  double clipping, evenness;

  CMP_RECORD("extractor.complete.image_quality.CellFigures", contrast, one, other, clipping, evenness)
};

// The figures of numbered markers (M, 2) px, NaN where lost; the noise, and the median length of the edges
// (E, 2).
std::tuple<CellFigures, double, double> measure_numbered(const image::PyramidLevel& view,
                                                         const SampledCells& cells, View<const double, 2> xy,
                                                         View<const std::int32_t, 2> edges,
                                                         const QualityLimits& limits);

}  // namespace cmp::complete
