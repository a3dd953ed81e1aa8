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
#include "refine/estimate.hpp"

namespace cmp::complete {

// Limits of repaired markers; explained in extractor/complete/repair.py.
struct RepairLimits {
  std::int64_t mild_support;
  double max_repaired_deviation, max_fitted_deviation, max_leverage;
  double model_deviation, fitted_model_sigmas;
  double mild_error, picture_departures, own_departures;
  LayerLimits layers;
  layout::NeighbourMapLimits maps;
  ConsistencyLimits consistency;
  UncertainLimits uncertain;

  template <class F>
  static RepairLimits read(const F& f) {
    return {f["mild_support"],
            f["max_repaired_deviation"],
            f["max_fitted_deviation"],
            f["max_leverage"],
            f["model_deviation"],
            f["fitted_model_sigmas"],
            f["mild_error"],
            f["picture_departures"],
            f["own_departures"],
            f["layers"],
            f["maps"],
            f["consistency"],
            f["uncertain"]};
  }
};

// The M markers after refinement.
struct RefinedMarkers {
  View<const double, 2> xy_px;    // (M, 2) NaN where not measured
  View<const double, 3> cov_px2;  // (M, 2, 2) NaN where not measured
  View<const bool, 1> explained;  // (M,) synthesis explains the image around the marker

  CMP_RECORD("extractor.refine.estimate.RefinedMarkers", xy_px, cov_px2, explained)
};

// xy_px, cov_px2 and status of RepairedMarkers.
using RepairedMarkers = std::tuple<Array<double, 2>, Array<double, 3>, Array<std::uint8_t, 1>>;

// The markers without those that contradict their neighbours, with the lost ones that are predicted, and with
// the uncertain ones fused with their predictions. No marker lies outside the image if any was lost or
// uncertain.
RepairedMarkers repair_markers(const RefinedMarkers& refined, const refine::StartPlaces& places,
                               const layout::RingTables& tables, const ImageSize& size,
                               const RepairLimits& limits);

}  // namespace cmp::complete
