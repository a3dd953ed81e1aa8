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

// Limits of virtual markers.
struct VirtualLimits {
  // in edges, of a measured point from the interpolated one; larger offsets are dirt. Chosen.
  double max_measured_offset = 0.08;
  // deviation of the interpolated point, as a share of its distance from the chord. Chosen.
  double bend_uncertainty = 0.05;
  refine::GridlineLimits gridlines;
};

// The M markers between which virtual ones lie.
struct LocatedMarkers {
  View<const double, 2> xy_px;         // (M, 2) NaN where lost
  View<const double, 3> cov_px2;       // (M, 2, 2) NaN where lost
  View<const std::uint8_t, 1> status;  // (M,)

  CMP_RECORD("extractor.complete.repair.RepairedMarkers", xy_px, cov_px2, status)
};

struct VirtualMarkers {
  Array<double, 3> xy_px;         // (E, m, 2)
  Array<double, 4> cov_px2;       // (E, m, 2, 2)
  Array<std::uint8_t, 2> status;  // (E, m)

  CMP_RECORD("extractor.result.VirtualMarkers", xy_px, cov_px2, status)
};

// The m virtual markers on each of E edges.
//
// points (E, m, 3): measured x and y (px) and their variance across the gridline (px^2), NaN for none.
VirtualMarkers locate_on_edges(const LocatedMarkers& markers, const refine::MarkerScatter& scatter,
                               const layout::Topology& topology, View<const double, 3> points,
                               const VirtualLimits& limits);

}  // namespace cmp::complete
