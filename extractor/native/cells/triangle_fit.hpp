// Stage 5: fits triangles to the regions that are triangles, first to their moments, then to their edges.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "cells/triangle_edges.hpp"
#include "image/pyramid.hpp"

namespace cmp::cells {

// The limits of the fit to moments; the Python module explains them.
struct MomentLimits {
  double min_area_px;
  double min_triangularity;
  double max_elongation;

  template <class F>
  static MomentLimits read(const F& f) {
    return {f["min_area_px"], f["min_triangularity"], f["max_elongation"]};
  }
};

// The limits of both fits.
struct TriangleLimits {
  MomentLimits moments;
  TriangleEdgeLimits edges;

  template <class F>
  static TriangleLimits read(const F& f) {
    return {f["moments"], f["edges"]};
  }
};

// Corners (N, 3, 2), and whether each region is a triangle (N,).
using FittedMoments = std::tuple<Array<double, 3>, Array<bool, 1>>;
// Corners (T, 3, 2), inks (T,) and regions (T,) of triangles.
using FoundTriangles = std::tuple<Array<double, 3>, Array<std::uint8_t, 1>, Array<std::int32_t, 1>>;

// The triangles with the regions' moments up to the third order; moments (N, 10) about the seed (N, 2).
FittedMoments fit_to_moments(View<const double, 2> moments, View<const std::int32_t, 2> seed,
                             const MomentLimits& limits);

// The regions that are triangles, with edges measured in the full image.
//
// moments (N, 10), seed (N, 2) and ink (N,) of the regions, at 1/scale of the image's scale.
FoundTriangles triangle_arrays(const image::PyramidLevel& view, View<const double, 2> moments,
                               View<const std::int32_t, 2> seed, View<const std::uint8_t, 1> ink, Index scale,
                               const TriangleLimits& limits);

}  // namespace cmp::cells
