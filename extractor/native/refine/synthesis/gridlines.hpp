// The gridlines between the current markers: cubic curves of the smooth map that the markers define.
//
// Gridlines are straight in the layout; the map to the image curves them. The map's derivative at every
// marker is estimated from the two rings of neighbours, and gives the direction of each gridline at that
// marker. The gridline is the cubic between two markers with these directions, as a C1-smooth interpolation
// of the map (Clough-Tocher) has it.
#pragma once

#include <cmath>

#include "base/array.hpp"

namespace cmp::refine {

// columns of a gridline: start, unit vector and length of the chord (px), slopes against the chord at both
// ends, known
inline constexpr Index X = 0, Y = 1, UX = 2, UY = 3, LENGTH = 4, LEAVE = 5, ARRIVE = 6, KNOWN = 7;
inline constexpr Index LINE_COLUMNS = 8;
inline constexpr Index FIRST_RING = 6;

// Limits of gridlines.
struct GridlineLimits {
  double max_slope = 0.5;  // of a gridline against its chord; a larger slope is an error of the map. Chosen.
  double min_length_px = 1.0;  // px, of the chord; no shorter gridline is known. Chosen.
  // of the neighbours of an incomplete ring, across to along; below it they lie on one line. Chosen.
  double min_spread = 0.2;
  Index min_neighbours = 2;         // fewer do not determine the slopes. Derived: two slopes.
  Index min_curved_neighbours = 5;  // with fewer the map is linear. Derived: five derivatives.
  Index min_firm_neighbours = 8;    // with fewer the curvature is held by weak_ridge. Chosen.
  // added to the diagonal of the second derivatives' normal equations with enough neighbours and with few;
  // the unit is that of the layout's vectors. Chosen.
  double firm_ridge = 0.001, weak_ridge = 0.02;
};

// Sets the second derivatives of the maps (M, 2, 5) to 0 at markers with fewer than six gridlines, spokes (M,
// 6), for pictures whose markers scatter: from one side, scatter makes more of them than bending.
void update_without_rim_curves(View<double, 3> maps, View<const std::int32_t, 2> spokes);

// Markers (M, 2) px with predictions, and (M,) the predicted ones.
struct ExtrapolatedMarkers {
  Array<double, 2> xy;
  Array<bool, 1> predicted;
};

// (M, 2, 5), the local map at each marker: derivatives of x and y by the layout's x, y, xx, xy, yy;
// NaN where unknown.
//
// Where all markers of the stencil are known, the derivatives are by the stencil. Elsewhere they are those of
// a quadratic through the known ones, whose second derivatives are regularised towards 0 and are 0 where
// fewer than five are known. xy (M, 2) px, NaN where unknown; near, offset and stencil: ring_markers,
// ring_vectors and derivative_stencil of the topology.
Array<double, 3> local_maps(View<const double, 2> xy, View<const std::int32_t, 2> near,
                            View<const double, 3> offset, View<const double, 3> stencil,
                            const GridlineLimits& limits);

// The same at some of the known markers, which (M,), only.
Array<double, 3> local_maps_at(View<const double, 2> xy, View<const bool, 1> which,
                               View<const std::int32_t, 2> near, View<const double, 3> offset,
                               View<const double, 3> stencil, const GridlineLimits& limits);

// xy (M, 2) px with unknown markers beside known ones predicted by their neighbours' maps (M, 2, 5).
ExtrapolatedMarkers extrapolate_markers(View<const double, 2> xy, View<const double, 3> maps,
                                        View<const std::int32_t, 2> near, View<const double, 3> offset);

// (M, 2) px: xy with ring after ring of unknown markers around the known ones predicted, `rings` times.
//
// The predictions are those of extrapolate_markers, with maps only at the known markers beside unknown ones.
Array<double, 2> extrapolate_rings(View<const double, 2> xy, View<const std::int32_t, 2> near,
                                   View<const double, 3> offset, View<const double, 3> stencil, Index rings,
                                   const GridlineLimits& limits);

// (E, 8): start and unit vector of the chord, its length, px; slopes against the chord at both ends, towards
// (-uy, ux); 1 where known. All 0 where unknown.
//
// xy (M, 2) px; maps (M, 2, 5), as local_maps gives them; bend (E, 2) px, b and s of the gridlines' bending,
// which add to the slopes; edges (E, 2) marker ids; along (E, 2), the topology's edge_vectors; scatter_share
// 0 to 1, how far slopes go from the maps' tangents to the cubic with the maps' second derivatives.
Array<double, 2> gridlines(View<const double, 2> xy, View<const double, 3> maps, View<const double, 2> bend,
                           View<const std::int32_t, 2> edges, View<const double, 2> along,
                           double scatter_share, const GridlineLimits& limits);

// The slopes of a gridline at its start and end, from those of the maps' tangents and from how the maps curve
// it at both ends (second derivative by the share of the chord, in the unit of the slopes).
//
// Where the direction of one end is unknown (NaN) the gridline is a parabola, where both are, straight.
struct EndSlopes {
  double leave, arrive;

  EndSlopes(double by_start, double by_end, double start_curve, double end_curve, double scatter_share)
      : leave(by_start), arrive(by_end) {
    if (!std::isfinite(arrive)) arrive = -leave;
    if (!std::isfinite(leave)) leave = -arrive;
    if (!std::isfinite(leave)) leave = arrive = 0.0;
    // the cubic with the second derivatives of both ends
    leave += scatter_share * (-(2.0 * start_curve + end_curve) / 6.0 - leave);
    arrive += scatter_share * ((start_curve + 2.0 * end_curve) / 6.0 - arrive);
  }
};

// px, the offset of a gridline from its chord at the fraction t of the chord; straight beyond the ends.
inline double sagitta(double t, double length, double leave, double arrive) {
  if (t <= 0.0) return length * leave * t;
  if (t >= 1.0) return length * arrive * (t - 1.0);
  return length * t * (1.0 - t) * (leave * (1.0 - t) - arrive * t);
}

}  // namespace cmp::refine
