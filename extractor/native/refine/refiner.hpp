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

// Limits and priors of the parallax of cells whose height is not known.
struct ParallaxLimits {
  // of the foot from the image's middle, in widths of the image: a tilt of 20 degrees. Chosen.
  double foot_deviation = 0.25;
  // the deviation of the shift of markers, in units of the change of the cells' size by the distance from the
  // foot. Derived: with independent uniform shares of both kinds of sides, half of their sum departs from its
  // mean as much as half of their difference, and the mean over directions of the parallax along a normal is
  // 2 / pi of it: pi / 2. Measured: 1.7 to 3.3 on recessed and raised pads of
  // `python -m benchmarks.photoreal`.
  double unseen = 2.0;
};

// The schedule of a preset; the Python class explains the fields.
struct Schedule {
  Index max_profile_rows;
  double small_remainder;

  CMP_RECORD("extractor.presets.Schedule", max_profile_rows, small_remainder)
};

// Limits of refinement.
struct RefinerLimits {
  FirstEstimateLimits first;
  // in edges, of the place of a lost marker on which all triangles agree. Chosen.
  double agreed_deviation = numbering::AGREED_DEVIATION;
  StepsLimits steps;
  FinalLimits final;
  RecoveryLimits recovery;
  ParallaxLimits parallax;
};

// The shift of cells above or below the black; the Python class explains the fields.
struct Parallax {
  Array<double, 1> foot_px;
  Array<double, 2> foot_cov_px2;
  double rate, rate_deviation;

  CMP_RECORD("extractor.refine.relief.Parallax", foot_px, foot_cov_px2, rate, rate_deviation)
};

// The appearance of an image; the Python class explains the fields.
struct Appearance {
  Index scale;
  double sigma, noise;
  LevelArrays levels;
  double pixel_noise;
  std::optional<Parallax> parallax;

  CMP_RECORD("extractor.refine.estimate.Appearance", scale, sigma, noise, levels, pixel_noise, parallax)
};

// The markers at the image's full scale; the Python class explains the fields.
struct RefinedMarkers {
  Array<double, 2> xy_px;
  Array<double, 3> cov_px2;
  Array<bool, 1> explained;
  double blur_px, noise;
  Appearance appearance;
  ReadGridlines reading;
  MarkerScatter scatter;

  CMP_RECORD("extractor.refine.estimate.RefinedMarkers", xy_px, cov_px2, explained, blur_px, noise,
             appearance, reading, scatter)
};

// Solves all markers together, by steps by synthesis.
//
// first, with places of the full image; stations, the points of each gridline that are measured, too.
RefinedMarkers refined_markers(const image::PyramidLevel& view, const layout::Topology& topology,
                               const FirstEstimate& first, const Schedule& schedule, Index stations,
                               const RefinerLimits& limits);

// The same from the first estimate of an image whose appearance is known; arguments as in first_estimate. A
// known parallax is kept: a contact must not move it, as all displacements would change.
RefinedMarkers refined_again(const image::PyramidLevel& view, const layout::Topology& topology,
                             const StartPlaces& places, const KnownAppearance& known,
                             const Schedule& schedule, Index stations, const RefinerLimits& limits);

}  // namespace cmp::refine
