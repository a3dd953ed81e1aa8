// Refinement after the first estimate: steps by synthesis, the tests of the markers, and the markers in the
// full image.
#pragma once

#include "base/array.hpp"
#include "numbering/marker_places.hpp"
#include "refine/acceptance.hpp"
#include "refine/first_estimate.hpp"
#include "refine/recovered_markers.hpp"
#include "refine/synthesis_steps.hpp"

namespace cmp::refine {

// Limits of refinement.
struct RefinerLimits {
  // in edges, of the place of a lost marker on which all triangles agree. Chosen.
  double agreed_deviation = numbering::AGREED_DEVIATION;
  StepsLimits steps;
  FinalLimits final;
  RecoveryLimits recovery;
};

// The markers at the image's full scale, and the appearance at the scale of the step; the Python class
// explains the fields.
struct MeasuredImage {
  Array<double, 2> xy_px;
  Array<double, 3> cov_px2;
  Array<bool, 1> explained;
  ReadGridlines reading;
  double sigma, noise, pixel_noise;
  LevelArrays levels;
  UnevenDotGain uneven_dot_gain;
  MarkerScatter scatter;

  CMP_RECORD("extractor.refine.estimate.MeasuredImage", xy_px, cov_px2, explained, reading, sigma, noise,
             pixel_noise, levels, uneven_dot_gain, scatter)
};

// Solves all markers together, by steps by synthesis.
//
// first, with places of the full image; small_remainder, as in synthesis_steps; stations, the points of each
// gridline that are measured, too.
MeasuredImage measure_image(const image::PyramidLevel& view, const layout::Topology& topology,
                            const FirstEstimate& first, double small_remainder, Index stations,
                            const RefinerLimits& limits);

}  // namespace cmp::refine
