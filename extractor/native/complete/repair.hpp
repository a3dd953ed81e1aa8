// Lost markers are repaired where that is safe, and uncertain ones are fused with their predictions.
//
// Mild omission (the article's eq. 6): the triangles around a lost marker imply its place; here all markers
// of two rings do, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers
// of the same layer and sextant, read at equidistant places.
#pragma once

#include "complete/consistency_filter.hpp"
#include "complete/layer_arcs.hpp"
#include "complete/uncertain_markers.hpp"
#include "layout/lattice_tables.hpp"
#include "layout/neighbour_tables.hpp"
#include "refine/first_estimate.hpp"

namespace cmp::complete {

// Status in extractor/result.py
inline constexpr std::uint8_t LOST = 0, MEASURED = 1, REPAIRED = 2, FITTED = 3;

// Limits of repaired markers. Distances and deviations are in edges, unless stated otherwise.
//
// The variance of a repaired marker has two parts. The stated errors of its neighbours are independent: each
// counts by the squared weight of the neighbour. The other part is the departure of the surface from the map,
// the larger of two estimates. By the neighbours' residuals: their deviation beyond noise counts mild_error *
// leverage times, as a smooth surface departs the more from the map the farther this extrapolates. By
// cross-validation: the neighbours are predicted from their own rings, too, and the variance of their
// departures beyond noise, over 1 + leverage, is that of markers that scatter. Measurements that were dropped
// as inconsistent count among these departures: where a whole row of them contradicts the map, as under a
// rolling shutter, the map may be what is wrong. The variance of a fitted marker has two parts, too
// (layer_arcs).
struct RepairLimits {
  std::int64_t mild_support = 10;  // known neighbours of two rings that make an omission mild. Chosen.
  // of a repaired marker: three such deviations stay below a quarter of an edge. Derived.
  double max_repaired_deviation = 0.08;
  // of a fitted marker: a layer's quadratic is wrong where the surface is bent. Measured: rule "repair by
  // layer".
  double max_fitted_deviation = 0.05;
  // of the neighbours' errors on a repaired marker. Measured: rule "repair by rings".
  double max_leverage = 1.2;
  double model_deviation = 0.012;  // of a smooth surface from a quadratic map. Chosen.
  // such deviations that are added to a layer's residual before it is compared with max_fitted_deviation.
  // Chosen.
  double fitted_model_sigmas = 3.0;
  // times leverage, of the departure by residuals. Measured: `python -m benchmarks.calibration` prints z of
  // repaired markers.
  double mild_error = 1.2;
  // departures, as many as those of the whole picture count beside those around a marker. Chosen.
  double picture_departures = 4.0;
  // as many as that of a marker's own dropped measurement counts. Chosen: with 1, a third of the markers that
  // a wobble of 3 to 6 px moves were repaired with too small a deviation.
  double own_departures = 4.0;
  LayerLimits layers;               // of a layer's quadratic
  layout::NeighbourMapLimits maps;  // of the predictions by neighbours
  ConsistencyLimits consistency;
  UncertainLimits uncertain;
};

// Of the appearance of an image.
struct SeenAppearance {
  std::optional<refine::KnownParallax> parallax;  // of cells above or below the black

  CMP_RECORD("extractor.refine.estimate.Appearance", parallax)
};

// The M markers after refinement.
struct RefinedMarkers {
  View<const double, 2> xy_px;    // (M, 2) NaN where not measured
  View<const double, 3> cov_px2;  // (M, 2, 2) NaN where not measured
  View<const bool, 1> explained;  // (M,) synthesis explains the image around the marker
  SeenAppearance appearance;

  CMP_RECORD("extractor.refine.estimate.RefinedMarkers", xy_px, cov_px2, explained, appearance)
};

// The markers after repair; the Python class explains them.
struct RepairedMarkers {
  Array<double, 2> xy_px;         // (M, 2)
  Array<double, 3> cov_px2;       // (M, 2, 2)
  Array<std::uint8_t, 1> status;  // (M,)

  CMP_RECORD("extractor.complete.repair.RepairedMarkers", xy_px, cov_px2, status)
};

// The markers without those that contradict their neighbours, with the lost ones that are predicted, and with
// the uncertain ones fused with their predictions. No marker lies outside the image if any was lost or
// uncertain.
RepairedMarkers repair_markers(const RefinedMarkers& refined, const refine::StartPlaces& places,
                               const layout::RingTables& tables, const ImageSize& size,
                               const RepairLimits& limits);

}  // namespace cmp::complete
