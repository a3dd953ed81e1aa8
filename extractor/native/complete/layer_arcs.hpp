// Heavy omission (the article's Fig. 8): a quadratic through the markers of one layer within a sextant.
#pragma once

#include "base/array.hpp"

namespace cmp::complete {

// Limits of the quadratics through layers.
struct LayerLimits {
  // known markers of a layer within a sextant, for a quadratic with a residual. Derived: three coefficients,
  // and two equations over.
  std::int64_t min_markers = 5;
  // degrees of freedom by which the residuals of all quadratics of the picture count beside those of one.
  // Chosen: as many as a quadratic through the fewest markers has.
  double picture_freedom = 4.0;
};

// Places of M markers on the quadratics through their layers and sextants.
struct LayerPrediction {
  Array<double, 2> xy_px;       // (M, 2) NaN where there are too few markers, as where a marker is known
  Array<double, 1> misfit_px2;  // (M,) from the marker to the quadratic, per axis, by its own residuals alone
  Array<double, 1> variance_px2;  // (M,) of the place, per axis; both are infinite without a place

  CMP_RECORD("extractor.complete.layer_arcs.LayerPlaces", xy_px, misfit_px2, variance_px2)
};

// Places of the unknown markers between known ones, on the quadratic through their layer and sextant.
//
// xy (M, 2) px, NaN where unknown; noise_px2 (M,) the variances of the known ones per axis. For a corner of
// the layer, which two sextants share, the place with the smaller misfit is taken.
LayerPrediction predict_by_layer(View<const double, 2> xy, View<const double, 1> noise_px2, Index layers,
                                 const LayerLimits& limits);

}  // namespace cmp::complete
