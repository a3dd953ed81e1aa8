// The first estimate of a picture: levels of the inks, blur, and the markers by a round of profiles.
#pragma once

#include <optional>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "numbering/marker_places.hpp"
#include "refine/estimate.hpp"
#include "refine/first_look.hpp"
#include "refine/outliers.hpp"
#include "refine/profile_rounds.hpp"

namespace cmp::refine {

// Limits of the first estimate.
struct FirstEstimateLimits {
  double default_sigma_px = 1.5;  // of the full image, assumed before the blur is measured. Chosen.
  // of a neighbour's level in the middle of a cell, above which bleed is removed. Chosen.
  double min_corrected_bleed = 0.002;
  FirstLookLimits look;
  ProfileLimits profiles;
  OutlierLimits outliers;
};

// The parallax of cells above or below the black, of the previous image of a sequence.
struct KnownParallax {
  View<const double, 1> foot_px;
  View<const double, 2> foot_cov_px2;
  double rate, rate_deviation;

  CMP_RECORD("extractor.refine.relief.Parallax", foot_px, foot_cov_px2, rate, rate_deviation)
};

// What the previous image of a sequence tells of this one; fields as in Appearance.
struct KnownAppearance {
  double sigma, noise, pixel_noise;
  InkLevels levels;
  std::optional<KnownParallax> parallax;

  CMP_RECORD("extractor.refine.estimate.Appearance", sigma, noise, pixel_noise, levels, parallax)
};

// The estimate after the round of profiles; the Python class explains the fields.
struct FirstEstimate {
  View<const double, 2> measured, reliable, bend;
  Information information;
  View<const double, 1> weight;
  double sigma, noise, pixel_noise, dot_gain;
  View<const double, 2> ink_shift;
  InkLevels levels;
  EdgeContrasts contrasts;
  StartPlaces places;

  CMP_RECORD("extractor.refine.estimate.FirstEstimate", measured, reliable, bend, information, weight, sigma,
             noise, pixel_noise, dot_gain, ink_shift, levels, contrasts, places)
};

// The same, with memory of its own.
struct FirstEstimateArrays {
  Array<double, 2> measured, reliable, bend;
  InformationArrays information;
  Array<double, 1> weight;
  double sigma, noise, pixel_noise, dot_gain;
  Array<double, 2> ink_shift;
  LevelArrays levels;
  ContrastArrays contrasts;
  numbering::InitialMarkers places;

  CMP_RECORD("extractor.refine.estimate.FirstEstimate", measured, reliable, bend, information, weight, sigma,
             noise, pixel_noise, dot_gain, ink_shift, levels, contrasts, places)
  operator FirstEstimate() const;
};

// The levels of the inks, the blur, and the round of profiles.
//
// start (M, 2) px in the full image, where the profiles are; places of the full image; rows of pixels across
// each gridline at most.
FirstEstimateArrays first_estimate(const image::PyramidLevel& view, const layout::Topology& topology,
                                   View<const double, 2> start, const StartPlaces& places,
                                   const std::optional<KnownAppearance>& known, Index rows,
                                   const FirstEstimateLimits& limits);

}  // namespace cmp::refine
