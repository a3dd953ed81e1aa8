// The smooth surface through markers: its gradients, and the virtual markers on it.
#pragma once

#include "base/array.hpp"

namespace cmp::space {

// The derivatives of values at M markers by the layout's x and y, (M, k, 2); NaN at unknown markers.
//
// weights (M, 2, K): of the differences to the K markers around each, NaN where these are too few. around (M,
// K): their ids, -1 for none. values (M, k): NaN where unknown.
Array<double, 3> gradients(View<const double, 3> weights, View<const std::int64_t, 2> around,
                           View<const double, 2> values);

// M markers on a surface, see Shape in extractor/space/reconstruction.py.
struct SurfaceMarkers {
  View<const double, 2> xyz_mm;   // (M, 3)
  View<const double, 3> cov_mm2;  // (M, 3, 3)
  View<const double, 3> slopes;   // (M, 3, 2) derivatives of xyz_mm
  View<const double, 2> normals;  // (M, 3)

  CMP_RECORD("extractor.space.reconstruction.SurfaceMarkers", xyz_mm, cov_mm2, slopes, normals)
};

// The m virtual markers on each of E edges; NaN where an end of the edge has no position.
struct SurfacePoints {
  Array<double, 3> xyz_mm;        // (E, m, 3)
  Array<double, 4> cov_mm2;       // (E, m, 3, 3)
  Array<double, 3> normals;       // (E, m, 3)
  Array<std::uint8_t, 2> status;  // (E, m)

  CMP_RECORD("extractor.space.reconstruction.SurfacePoints", xyz_mm, cov_mm2, normals, status)
};

// The places are on the cubic with the surface's slopes at both ends, which is an edge of the element of
// Clough and Tocher, or with the chord where a slope is unknown. The covariances are those of the ends; the
// normals lie between theirs.
//
// edges (E, 2) marker ids. steps_mm (E, 2): from start to end in the layout. count: m.
SurfacePoints points_on_edges(const SurfaceMarkers& markers, View<const std::int32_t, 2> edges,
                              View<const double, 2> steps_mm, std::int64_t count);

}  // namespace cmp::space
