// Markers that contradict their neighbours are dropped: a marker must lie where the map of its two rings puts
// it.
#pragma once

#include <array>
#include <tuple>

#include "layout/lattice_tables.hpp"
#include "layout/neighbour_tables.hpp"

namespace cmp::complete {

using ImageSize = std::array<Index, 2>;  // width and height, px

// Limits of markers that do not contradict their neighbours. Distances and deviations are in edges.
struct ConsistencyLimits {
  // of rejection; each round drops the worst marker of every neighbourhood. Measured: rule "ring outliers".
  std::int64_t max_rounds = 40;
  // between a marker and its prediction by two rings. Measured: `python -m benchmarks.acceptance`.
  double max_distance = 0.14;
  // of the prediction of a marker that only two triangles confirm. Measured: rule "confirmed".
  double max_predicted_deviation = 0.12;
  // of a marker that is obstructed, and the deviation of its prediction. Measured: rule "unexplained".
  double max_unexplained_distance = 0.06;
  layout::NeighbourMapLimits maps;  // of the predictions
};

// Results of earlier stages for the tests of markers, for each of M markers.
struct MarkerEvidence {
  View<const bool, 1> explained;  // (M,) synthesis explains the image around the marker
  View<const double, 1> edge_px;  // (M,) the mean edge at the marker
  View<const bool, 1> agreed;     // (M,) all triangles of the marker, or at least two, were found and agree
  View<const bool, 1> is_intact;  // (M,) all triangles of the marker, and at least two, were found and agree
};

using ConsistentEdges = std::tuple<Array<double, 1>, bool>;

// Whether a place lies within the image, up to the outer edges of its pixels; false for NaN.
inline bool is_inside_image(double x, double y, const ImageSize& size) {
  return x >= -0.5 && y >= -0.5 && x <= static_cast<double>(size[0]) - 0.5 &&
         y <= static_cast<double>(size[1]) - 0.5;
}

// Sets inconsistent markers, xy (M, 2) and cov (M, 2, 2), to NaN; (M,) the edge at each marker, px, and
// whether all markers are consistent.
ConsistentEdges update_rejecting_inconsistent(View<double, 2> xy, View<double, 3> cov,
                                              const MarkerEvidence& evidence,
                                              const layout::RingTables& tables, const ImageSize& size,
                                              const ConsistencyLimits& limits);

}  // namespace cmp::complete
