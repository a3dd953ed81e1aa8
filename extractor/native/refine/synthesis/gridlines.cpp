#include "refine/synthesis/gridlines.hpp"

#include <cmath>
#include <limits>

#include "localmap/local_map.hpp"

namespace cmp::refine {

namespace {

constexpr Index DERIVATIVES = 5;
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

// Writes the map (2, 5) at marker m; NaN where a neighbour is unknown. near (K,), stencil (K, 5).
void fill_derivatives(View<const double, 2> xy, Index m, View<const std::int32_t, 1> near,
                      View<const double, 2> stencil, View<double, 2> out) {
  std::array<double, DERIVATIVES> to_x{}, to_y{};
  const double x = xy(m, 0), y = xy(m, 1);
  for (Index k = 0; k < near.size(); ++k) {
    const Index n = near[k];
    if (n < 0) continue;
    const double dx = xy(n, 0) - x, dy = xy(n, 1) - y;
    const double* const weight = &stencil(k, 0);
    for (Index d = 0; d < DERIVATIVES; ++d) to_x[d] += weight[d] * dx;
    for (Index d = 0; d < DERIVATIVES; ++d) to_y[d] += weight[d] * dy;
  }
  for (Index d = 0; d < DERIVATIVES; ++d) {
    out(0, d) = to_x[d];
    out(1, d) = to_y[d];
  }
}

// Writes the map (2, 5) at marker m through the known ones of `near` (K,) at `offset` (K, 2), if these
// determine it.
void fill_quadratic_derivatives(View<const double, 2> xy, Index m, View<const std::int32_t, 1> near,
                                View<const double, 2> offset, View<double, 2> out,
                                const GridlineLimits& limits) {
  localmap::LocalMap<2> map({0.0, 0.0, 1.0, xy(m, 0), xy(m, 1), 1.0});
  Index known = 0;
  for (Index k = 0; k < near.size(); ++k) {
    const Index n = near[k];
    if (n < 0 || !std::isfinite(xy(n, 0))) continue;
    const double u = offset(k, 0), v = offset(k, 1), square = u * u + v * v;
    map.add(u, v, xy(n, 0), xy(n, 1), 1.0 / (square * square));
    ++known;
  }
  if (known < limits.min_neighbours) return;
  double ridge = localmap::RIGID;
  if (known >= limits.min_curved_neighbours)
    ridge = known >= limits.min_firm_neighbours ? limits.firm_ridge : limits.weak_ridge;
  // of the second derivatives, of which the terms u^2 and v^2 have half
  if (!map.solve({.constant = localmap::RIGID, .square = 4.0 * ridge, .mixed = ridge}, limits.min_spread))
    return;
  for (int axis = 0; axis < 2; ++axis) {
    const auto& terms = map.coefficients(axis);
    out(axis, 0) = terms[1];
    out(axis, 1) = terms[2];
    out(axis, 2) = 2.0 * terms[3];
    out(axis, 3) = terms[4];
    out(axis, 4) = 2.0 * terms[5];
  }
}

// The slope of a gridline, `along` (2,) in the layout, against its chord (ux, uy) at a marker with a map (2,
// 5); NaN where the map is unknown or wrong.
double slope_at(View<const double, 2> map, View<const double, 1> along, double ux, double uy,
                double max_slope) {
  const double tx = map(0, 0) * along[0] + map(0, 1) * along[1];
  const double ty = map(1, 0) * along[0] + map(1, 1) * along[1];
  const double forward = tx * ux + ty * uy;
  const double slope = (ty * ux - tx * uy) / forward;
  return forward > 0.0 && std::abs(slope) < max_slope ? slope : NOT_A_NUMBER;
}

// The place at (u, v) in the layout from a marker, along one axis of the image, by the marker's map (5,).
double mapped(double place, View<const double, 1> map, double u, double v) {
  return place + u * map[0] + v * map[1];
}

double curvature(View<const double, 1> map, double u, double v) {
  return 0.5 * u * u * map[2] + u * v * map[3] + 0.5 * v * v * map[4];
}

// How far a gridline, `along` (2,) in the layout, curves to the normal of its chord (ux, uy) by the map (2,
// 5) at a marker, px: its second derivative by the share of the chord; 0 where the map is unknown.
double curved_by(View<const double, 2> map, View<const double, 1> along, double ux, double uy) {
  const double x = 2.0 * curvature(map[0], along[0], along[1]);
  const double y = 2.0 * curvature(map[1], along[0], along[1]);
  const double normal = y * ux - x * uy;
  return std::isfinite(normal) ? normal : 0.0;
}

}  // namespace

Array<double, 3> local_maps(View<const double, 2> xy, View<const std::int32_t, 2> near,
                            View<const double, 3> offset, View<const double, 3> stencil,
                            const GridlineLimits& limits) {
  Array<bool, 1> known({xy.size()});
  for (Index m = 0; m < xy.size(); ++m) known[m] = std::isfinite(xy(m, 0));
  return local_maps_at(xy, known, near, offset, stencil, limits);
}

Array<double, 3> local_maps_at(View<const double, 2> xy, View<const bool, 1> which,
                               View<const std::int32_t, 2> near, View<const double, 3> offset,
                               View<const double, 3> stencil, const GridlineLimits& limits) {
  Array<double, 3> maps({xy.size(), 2, 5}, NOT_A_NUMBER);
  const auto out = maps.view();
  for (Index m = 0; m < xy.size(); ++m) {
    if (!which[m]) continue;
    const bool has_stencil = stencil(m, 0, 0) != 0.0 || stencil(m, 1, 0) != 0.0;
    if (has_stencil) fill_derivatives(xy, m, near[m], stencil[m], out[m]);
    if (!std::isfinite(out(m, 0, 0))) {
      out[m].fill(NOT_A_NUMBER);
      fill_quadratic_derivatives(xy, m, near[m], offset[m], out[m], limits);
    }
  }
  return maps;
}

void update_without_rim_curves(View<double, 3> maps, View<const std::int32_t, 2> spokes) {
  for (Index m = 0; m < maps.size(); ++m) {
    if (spokes(m, spokes.size(1) - 1) >= 0) continue;
    for (Index axis = 0; axis < 2; ++axis) {
      for (Index d = 2; d < DERIVATIVES; ++d) maps(m, axis, d) = 0.0;
    }
  }
}

ExtrapolatedMarkers extrapolate_markers(View<const double, 2> xy, View<const double, 3> maps,
                                        View<const std::int32_t, 2> near, View<const double, 3> offset) {
  ExtrapolatedMarkers out{Array<double, 2>(xy), Array<bool, 1>({xy.size()}, false)};
  for (Index m = 0; m < xy.size(); ++m) {
    if (std::isfinite(xy(m, 0))) continue;
    double x = 0.0, y = 0.0;
    Index count = 0;
    for (Index k = 0; k < FIRST_RING; ++k) {
      const Index n = near(m, k);
      if (n < 0 || !std::isfinite(maps(n, 0, 0))) continue;
      const double u = -offset(m, k, 0), v = -offset(m, k, 1);
      const auto map_x = maps[n][0], map_y = maps[n][1];
      x += mapped(xy(n, 0), map_x, u, v);
      x += curvature(map_x, u, v);
      y += mapped(xy(n, 1), map_y, u, v);
      y += curvature(map_y, u, v);
      ++count;
    }
    if (count > 0) {
      out.xy(m, 0) = x / static_cast<double>(count);
      out.xy(m, 1) = y / static_cast<double>(count);
      out.predicted[m] = true;
    }
  }
  return out;
}

Array<double, 2> extrapolate_rings(View<const double, 2> xy, View<const std::int32_t, 2> near,
                                   View<const double, 3> offset, View<const double, 3> stencil, Index rings,
                                   const GridlineLimits& limits) {
  Array<double, 2> out(xy);
  for (Index ring = 0; ring < rings; ++ring) {
    Array<bool, 1> needed({xy.size()}, false);
    bool is_any_needed = false;
    for (Index m = 0; m < xy.size(); ++m) {
      if (std::isfinite(out(m, 0))) continue;
      for (Index k = 0; k < FIRST_RING; ++k) {
        const Index n = near(m, k);
        if (n < 0 || !std::isfinite(out(n, 0))) continue;
        needed[n] = true;
        is_any_needed = true;
      }
    }
    if (!is_any_needed) break;
    out =
        extrapolate_markers(out, local_maps_at(out, needed, near, offset, stencil, limits), near, offset).xy;
  }
  return out;
}

Array<double, 2> gridlines(View<const double, 2> xy, View<const double, 3> maps, View<const double, 2> bend,
                           View<const std::int32_t, 2> edges, View<const double, 2> along,
                           double scatter_share, const GridlineLimits& limits) {
  Array<double, 2> out({edges.size(), LINE_COLUMNS}, 0.0);
  for (Index e = 0; e < edges.size(); ++e) {
    const Index a = edges(e, 0), b = edges(e, 1);
    const double dx = xy(b, 0) - xy(a, 0), dy = xy(b, 1) - xy(a, 1);
    const double length = std::sqrt(dx * dx + dy * dy);
    if (!(length > limits.min_length_px)) continue;
    const double ux = dx / length, uy = dy / length;
    const auto slope = [&](Index m) { return slope_at(maps[m], along[e], ux, uy, limits.max_slope); };
    const auto curve = [&](Index m) {
      return scatter_share > 0.0 ? curved_by(maps[m], along[e], ux, uy) / length : 0.0;
    };
    const auto [leave, arrive] = EndSlopes(slope(a), slope(b), curve(a), curve(b), scatter_share);
    const auto line = out[e];
    line[X] = xy(a, 0);
    line[Y] = xy(a, 1);
    line[UX] = ux;
    line[UY] = uy;
    line[LENGTH] = length;
    line[LEAVE] = leave + (bend(e, 1) + bend(e, 0)) / length;
    line[ARRIVE] = arrive + (bend(e, 1) - bend(e, 0)) / length;
    line[KNOWN] = 1.0;
  }
  return out;
}

}  // namespace cmp::refine
