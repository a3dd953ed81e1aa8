// Virtual markers: points on the gridlines between two markers, numbered by edge and place (section III-B-3).
//
// Along the gridline, a virtual marker is interpolated by the smooth map that the markers define. Across the
// gridline, it is measured.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/marker_scatter.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::complete {

// Limits of virtual markers; explained in extractor/complete/virtual_markers.py.
struct VirtualLimits {
  double max_measured_offset, bend_uncertainty;
  refine::GridlineLimits gridlines;

  template <class F>
  static VirtualLimits read(const F& f) {
    return {f["max_measured_offset"], f["bend_uncertainty"], f["gridlines"]};
  }
};

// The M markers between which virtual ones lie.
struct LocatedMarkers {
  View<const double, 2> xy_px;         // (M, 2) NaN where lost
  View<const double, 3> cov_px2;       // (M, 2, 2) NaN where lost
  View<const std::uint8_t, 1> status;  // (M,)

  template <class F>
  static LocatedMarkers read(const F& f) {
    return {f["xy_px"], f["cov_px2"], f["status"]};
  }
};

// (E, m, 2) px and (E, m, 2, 2) px^2, NaN where lost; (E, m) the status.
using VirtualMarkers = std::tuple<Array<double, 3>, Array<double, 4>, Array<std::uint8_t, 2>>;

// The m virtual markers on each of E edges.
//
// points (E, m, 3): measured x and y (px) and their variance across the gridline (px^2), NaN for none.
VirtualMarkers locate_on_edges(const LocatedMarkers& markers, const refine::MarkerScatter& scatter,
                               const layout::Topology& topology, View<const double, 3> points,
                               const VirtualLimits& limits);

}  // namespace cmp::complete
