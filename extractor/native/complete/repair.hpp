// Lost markers are repaired where that is safe, and uncertain ones are fused with their predictions.
//
// Mild omission (the article's eq. 6): the triangles around a lost marker imply its place; here all markers
// of two rings do, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers
// of the same layer and sextant, read at equidistant places.
#pragma once

#include "complete/consistency_filter.hpp"
#include "complete/layer_arcs.hpp"
#include "layout/lattice_tables.hpp"
#include "layout/neighbour_tables.hpp"

namespace cmp::complete {

// Limits of repaired markers; explained in extractor/complete/repair.py.
struct RepairLimits {
  std::int64_t mild_support;
  double max_repaired_deviation, max_fitted_deviation, max_leverage;
  double model_deviation, fitted_model_sigmas;
  double mild_error;
  LayerLimits layers;
  layout::NeighbourMapLimits maps;

  template <class F>
  static RepairLimits read(const F& f) {
    return {f["mild_support"],
            f["max_repaired_deviation"],
            f["max_fitted_deviation"],
            f["max_leverage"],
            f["model_deviation"],
            f["fitted_model_sigmas"],
            f["mild_error"],
            f["layers"],
            f["maps"]};
  }
};

// M markers before repair.
struct UnrepairedMarkers {
  View<double, 2> xy_px;          // (M, 2) NaN where lost; written
  View<double, 3> cov_px2;        // (M, 2, 2) NaN where lost; written
  View<const bool, 1> uncertain;  // (M,)
  View<const double, 1> edge_px;  // (M,) edge at each marker

  template <class F>
  static UnrepairedMarkers read(const F& f) {
    return {f["xy_px"], f["cov_px2"], f["uncertain"], f["edge_px"]};
  }
};

// Writes places and covariances of the lost markers that are predicted, and fuses the uncertain ones; markers
// outside the image become NaN. (M,) the status of all markers.
Array<std::uint8_t, 1> fill_lost_markers(const UnrepairedMarkers& markers, const layout::RingTables& tables,
                                         const ImageSize& size, const RepairLimits& limits);

}  // namespace cmp::complete
