// Predicts a marker's place from its neighbours by a local quadratic map from layout to image.
#pragma once

#include <tuple>

#include "layout/neighbour_tables.hpp"

namespace cmp::localmap {

using layout::NeighbourMapLimits;

// Predictions of M markers by their neighbours; NaN where the neighbours are too few or on a line.
struct MarkerPredictions {
  Array<double, 2> xy_px;         // (M, 2) the predicted places
  Array<double, 1> variance_px2;  // (M,) the residual variance per axis of the neighbours
  Array<double, 1> leverage;      // (M,) from the variance of the neighbours to that of the prediction
  Array<double, 1> noise_px2;     // (M,) the variance per axis of the prediction by the neighbours' noise
  Array<double, 1> neighbour_noise_px2;    // (M,) the mean of the neighbours' noise
  Array<std::int32_t, 1> neighbour_count;  // (M,) the number of known neighbours

  CMP_RECORD("extractor.localmap.neighbour_prediction.MarkerPredictions", xy_px, variance_px2, leverage,
             noise_px2, neighbour_noise_px2, neighbour_count)
};

// Whether a known marker m lies farther than limit_px from its prediction by the neighbours; also true where
// the neighbours are too few or not all known.
//
// xy_px (M, 2); weights (M, K) of the neighbours in `table` (M, K), as ring_weights of RingTables.
inline bool is_neighbour_outlier(View<const double, 2> xy_px, Index m, double limit_px,
                                 View<const double, 2> weights, View<const std::int32_t, 2> table) {
  double x = xy_px(m, 0), y = xy_px(m, 1);
  for (Index k = 0; k < table.size(1); ++k) {
    const std::int32_t j = table(m, k);
    if (j < 0) continue;
    x -= weights(m, k) * xy_px(j, 0);
    y -= weights(m, k) * xy_px(j, 1);
  }
  return !(x * x + y * y <= limit_px * limit_px);  // true for NaN
}

// Predicts the wanted markers (M,) from their neighbours; a marker's own place is not used.
//
// xy_px (M, 2) the markers' places, NaN unknown; noise_px2 (M,) their variances per axis; marker_mm (M, 2) in
// the layout; table (M, K), the neighbours of each marker, or -1.
MarkerPredictions predict_markers(View<const double, 2> xy_px, View<const double, 1> noise_px2,
                                  View<const bool, 1> wanted, View<const double, 2> marker_mm,
                                  View<const std::int32_t, 2> table, const NeighbourMapLimits& limits);

}  // namespace cmp::localmap
