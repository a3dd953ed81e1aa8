#include "localmap/neighbour_prediction.hpp"

#include <cmath>
#include <limits>

#include "localmap/ring_maps.hpp"
#include "numeric/dense_systems.hpp"

namespace cmp::localmap {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr Index CUBIC_TERMS = 10;      // 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3
constexpr double SMALLEST_MM = 1e-12;  // to divide by

using CubicTerms = std::array<double, CUBIC_TERMS>;
using CubicMatrix = std::array<CubicTerms, CUBIC_TERMS>;

// A known neighbour: its place in the layout, relative to the marker, and in the image, px.
struct Neighbour {
  double x, y, u, v;
};

// The known neighbours of one marker.
struct Neighbours {
  std::array<Neighbour, layout::RING_MARKERS> items;
  Index count = 0;
};

// The known neighbours of marker m; x and y are in units of their mean distance.
Neighbours known_neighbours(View<const double, 2> xy_px, Index m, View<const double, 2> marker_mm,
                            View<const std::int32_t, 2> table) {
  Neighbours found;
  double scale = 0.0;
  for (const std::int32_t j : table[m]) {
    if (j < 0 || std::isnan(xy_px(j, 0))) continue;
    const double x = marker_mm(j, 0) - marker_mm(m, 0), y = marker_mm(j, 1) - marker_mm(m, 1);
    found.items[found.count++] = {x, y, xy_px(j, 0), xy_px(j, 1)};
    scale += std::hypot(x, y);
  }
  const double factor = static_cast<double>(found.count) / std::max(scale, SMALLEST_MM);
  for (Index k = 0; k < found.count; ++k) {
    found.items[k].x *= factor;
    found.items[k].y *= factor;
  }
  return found;
}

CubicTerms cubic_terms(double x, double y) {
  return {1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y};
}

// The residual variance per axis, px^2, of the cubic map through the neighbours.
double cubic_variance_of(const Neighbours& neighbours, double min_pivot) {
  CubicMatrix normal{};
  std::array<CubicTerms, 2> sides{};  // for x and y
  std::array<CubicTerms, layout::RING_MARKERS> rows;
  for (Index k = 0; k < neighbours.count; ++k) {
    const Neighbour& own = neighbours.items[k];
    const CubicTerms row = cubic_terms(own.x, own.y);
    for (Index a = 0; a < CUBIC_TERMS; ++a) {
      sides[0][a] += row[a] * own.u;
      sides[1][a] += row[a] * own.v;
      for (Index b = 0; b <= a; ++b) normal[a][b] += row[a] * row[b];
    }
    rows[k] = row;
  }
  const View<double, 2> gram(normal[0].data(), {CUBIC_TERMS, CUBIC_TERMS});
  const View<double, 2> right(sides[0].data(), {2, CUBIC_TERMS});
  if (!numeric::update_to_cholesky_solution(gram, right, CUBIC_TERMS, min_pivot)) return INFINITE;
  double squares = 0.0;
  for (const bool is_x : {true, false}) {
    const CubicTerms& side = is_x ? sides[0] : sides[1];
    for (Index k = 0; k < neighbours.count; ++k) {
      double misfit = is_x ? neighbours.items[k].u : neighbours.items[k].v;
      for (Index a = 0; a < CUBIC_TERMS; ++a) misfit -= rows[k][a] * side[a];
      squares += misfit * misfit;
    }
  }
  return squares / (2.0 * static_cast<double>(neighbours.count - CUBIC_TERMS));
}

// Solves the maps in the first `count` lanes and writes the predictions of their markers.
void fill_predictions(const std::array<Index, numeric::LANES>& members, Index count, double min_pivot,
                      RingMaps& maps, MarkerPredictions& out) {
  maps.solve(min_pivot);
  for (Index lane = 0; lane < count; ++lane) {
    if (!maps.is_determined(lane)) continue;
    const Index m = members[lane];
    const Index terms = maps.is_quadratic(lane) ? layout::QUADRATIC_TERMS : layout::LINEAR_TERMS;
    out.xy_px(m, 0) = maps.x(lane);
    out.xy_px(m, 1) = maps.y(lane);
    out.leverage[m] = maps.leverage(lane);
    const double degrees = 2.0 * static_cast<double>(std::max<Index>(out.neighbour_count[m] - terms, 1));
    out.variance_px2[m] = maps.squared_misfit(lane) / degrees;
  }
}

}  // namespace

MarkerPredictions predict_markers(View<const double, 2> xy_px, View<const bool, 1> wanted,
                                  View<const double, 2> marker_mm, View<const std::int32_t, 2> table,
                                  const NeighbourMapLimits& limits) {
  const Index count = xy_px.size();
  MarkerPredictions out{Array<double, 2>({count, 2}, NOWHERE), Array<double, 1>({count}, NOWHERE),
                        Array<double, 1>({count}, NOWHERE), Array<std::int32_t, 1>({count}, 0)};
  RingMaps maps(table.size(1));
  std::array<Index, numeric::LANES> members;
  Index filled = 0;
  for (Index m = 0; m < count; ++m) {
    if (!wanted[m]) continue;
    const Index n = maps.fill_neighbours(xy_px, m, filled, marker_mm, table);
    out.neighbour_count[m] = static_cast<std::int32_t>(n);
    if (n < limits.min_linear_neighbours) continue;
    maps.set_quadratic(filled, n >= limits.min_quadratic_neighbours);
    members[filled++] = m;
    if (filled < numeric::LANES) continue;
    fill_predictions(members, filled, limits.min_pivot, maps, out);
    filled = 0;
  }
  if (filled > 0) fill_predictions(members, filled, limits.min_pivot, maps, out);
  return out;
}

Array<double, 1> cubic_variance(View<const double, 2> xy_px, View<const bool, 1> wanted,
                                View<const double, 2> marker_mm, View<const std::int32_t, 2> table,
                                const NeighbourMapLimits& limits) {
  Array<double, 1> out({xy_px.size()}, INFINITE);
  for (Index m = 0; m < wanted.size(); ++m) {
    if (!wanted[m]) continue;
    const Neighbours neighbours = known_neighbours(xy_px, m, marker_mm, table);
    if (neighbours.count >= limits.min_cubic_neighbours)
      out[m] = cubic_variance_of(neighbours, limits.min_pivot);
  }
  return out;
}

}  // namespace cmp::localmap
