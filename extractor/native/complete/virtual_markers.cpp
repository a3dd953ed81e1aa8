#include "complete/virtual_markers.hpp"

#include <cmath>
#include <limits>

namespace cmp::complete {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
// VirtualStatus in extractor/result.py
constexpr std::uint8_t LOST = 0, MEASURED = 1, INTERPOLATED = 2;

struct Vector {
  double x, y;
};

double square(double x) { return x * x; }

// The M markers at the ends of the gridlines.
struct GridlineEnds {
  View<const double, 2> xy_px;    // (M, 2)
  View<const double, 3> cov_px2;  // (M, 2, 2)
  View<const bool, 1> known;      // (M,)
  View<const double, 3> maps;     // (M, 2, 5) the local map at each marker
  refine::MarkerScatter scatter;
};

// The derivative of the map at marker m along `edge`, a vector of the layout, px per edge; the chord where it
// is unknown.
Vector edge_tangent(const GridlineEnds& ends, Index m, Vector edge, Vector chord) {
  const auto map = ends.maps[m];
  if (!std::isfinite(map(0, 0))) return chord;
  return {map(0, 0) * edge.x + map(0, 1) * edge.y, map(1, 0) * edge.x + map(1, 1) * edge.y};
}

// The second derivatives of the map at marker m along edge e, px; 0 where they are unknown.
Vector curvature(const GridlineEnds& ends, const layout::Topology& topology, Index m, Index e) {
  const auto map = ends.maps[m];
  const double u = topology.edge_vectors(e, 0), v = topology.edge_vectors(e, 1);
  const double x = u * u * map(0, 2) + 2 * u * v * map(0, 3) + v * v * map(0, 4);
  const double y = u * u * map(1, 2) + 2 * u * v * map(1, 3) + v * v * map(1, 4);
  return std::isfinite(x) && std::isfinite(y) ? Vector{x, y} : Vector{0.0, 0.0};
}

// Moves a tangent towards that of the cubic with the second derivatives `near` and `far` of both ends.
void update_for_scatter(Vector& tangent, Vector chord, Vector near, Vector far, double share) {
  tangent.x += share * (chord.x - (2 * near.x + far.x) / 6 - tangent.x);
  tangent.y += share * (chord.y - (2 * near.y + far.y) / 6 - tangent.y);
}

// A virtual marker from the start of its edge: place, covariance, the part of its variance by unknown
// bending, and status.
struct Located {
  double x, y, xx, cross, yy, by_bending;
  std::uint8_t status;
};

// The gridline along an edge: a cubic Hermite curve through both markers with the map's derivatives there.
struct Gridline {
  double x0, y0, length;
  Vector chord, along, leaving, arriving;
  View<const double, 2> cov_a, cov_b;

  Gridline(const GridlineEnds& ends, const layout::Topology& topology, Index e, Index a, Index b)
      : x0(ends.xy_px(a, 0)),
        y0(ends.xy_px(a, 1)),
        chord{ends.xy_px(b, 0) - x0, ends.xy_px(b, 1) - y0},
        cov_a(ends.cov_px2[a]),
        cov_b(ends.cov_px2[b]) {
    length = std::sqrt(chord.x * chord.x + chord.y * chord.y);
    along = {chord.x / length, chord.y / length};
    const double u = topology.edge_vectors(e, 0), v = topology.edge_vectors(e, 1);
    leaving = edge_tangent(ends, a, {u, v}, chord);
    arriving = edge_tangent(ends, b, {-u, -v}, {-chord.x, -chord.y});
    if (ends.scatter.share == 0.0) return;
    const Vector at_a = curvature(ends, topology, a, e), at_b = curvature(ends, topology, b, e);
    update_for_scatter(leaving, chord, at_a, at_b, ends.scatter.share);
    update_for_scatter(arriving, {-chord.x, -chord.y}, at_b, at_a, ends.scatter.share);
  }

  // the interpolated point at the share t of the edge
  Located at(double t, double bend_uncertainty, double free_variance) const {
    const double s = 1.0 - t;
    const double end = t * t * (3 - 2 * t), slope_a = s * s * t, slope_b = s * t * t;
    const double x = end * chord.x + slope_a * leaving.x + slope_b * arriving.x;
    const double y = end * chord.y + slope_a * leaving.y + slope_b * arriving.y;
    const double bend_variance =
        square(bend_uncertainty) * (square(x - t * chord.x) + square(y - t * chord.y)) +
        square(s * t) * free_variance;
    return {x,
            y,
            s * s * cov_a(0, 0) + t * t * cov_b(0, 0) + bend_variance,
            s * s * cov_a(0, 1) + t * t * cov_b(0, 1),
            s * s * cov_a(1, 1) + t * t * cov_b(1, 1) + bend_variance,
            bend_variance,
            INTERPOLATED};
  }

  // moves a point across the gridline to the measured one (3,), unless that is farther away than the limit
  void update_to_measured(View<const double, 1> measured, double limit_px, Located& point) const {
    const auto [tx, ty] = along;
    const double across = (measured[1] - y0 - point.y) * tx - (measured[0] - x0 - point.x) * ty;
    if (!(std::abs(across) < limit_px)) return;  // also for NaN, where no point was measured
    point.x -= across * ty;
    point.y += across * tx;
    const double along2 = point.xx * tx * tx + 2 * point.cross * tx * ty + point.yy * ty * ty;
    const double across2 = measured[2];
    point.xx = along2 * tx * tx + across2 * ty * ty;
    point.cross = (along2 - across2) * tx * ty;
    point.yy = along2 * ty * ty + across2 * tx * tx;
    point.status = MEASURED;
  }
};

// How an interpolated point moves with the markers from which its map and its edge follow.
class MarkerWeights {
 public:
  MarkerWeights(const GridlineEnds& ends, const layout::Topology& topology)
      : ends_(ends),
        topology_(topology),
        weight_({ends.xy_px.size()}, 0.0),
        markers_({2 * (topology.ring_markers.size(1) + 2)}) {}

  // whether the map at marker m is that of the stencil, through known markers
  bool is_by_stencil(Index m) const {
    if (topology_.derivative_stencil(m, 0, 0) == 0.0 && topology_.derivative_stencil(m, 1, 0) == 0.0)
      return false;
    for (const std::int32_t n : topology_.ring_markers[m])
      if (n >= 0 && !ends_.known[n]) return false;
    return true;
  }

  // writes the covariance of the point at the share t of edge e by the independent errors of the markers
  void update_covariance(Index e, double t, Located& point) {
    const double s = 1.0 - t, share = ends_.scatter.share, end = t * t * (3 - 2 * t);
    const double slope_a = s * s * t, slope_b = s * t * t;
    const Index a = topology_.edges(e, 0), b = topology_.edges(e, 1);
    count_ = 0;
    add(b, end + share * (slope_a - slope_b));
    add(a, 1.0 - end - share * (slope_a - slope_b));
    add_map(a, e, (1.0 - share) * slope_a, -share * (2 * slope_a + slope_b) / 6);
    add_map(b, e, -(1.0 - share) * slope_b, -share * (2 * slope_b + slope_a) / 6);
    point.xx = point.yy = point.by_bending;
    point.cross = 0.0;
    for (const Index m : markers_.view().slice(0, count_)) {
      const double square = weight_[m] * weight_[m];
      point.xx += square * ends_.cov_px2(m, 0, 0);
      point.cross += square * ends_.cov_px2(m, 0, 1);
      point.yy += square * ends_.cov_px2(m, 1, 1);
      weight_[m] = 0.0;
    }
  }

 private:
  void add(Index m, double weight) {
    if (weight_[m] == 0.0) markers_[count_++] = m;
    weight_[m] += weight;
  }

  // adds the first and the second derivative along edge e by the map at marker m, each times a factor
  void add_map(Index m, Index e, double first, double second) {
    const double u = topology_.edge_vectors(e, 0), v = topology_.edge_vectors(e, 1);
    const auto stencil = topology_.derivative_stencil[m];
    double total = 0.0;
    for (Index k = 0; k < stencil.size(0); ++k) {
      const std::int32_t n = topology_.ring_markers(m, k);
      if (n < 0) continue;
      const auto by = stencil[k];
      const double curving = u * u * by[2] + 2 * u * v * by[3] + v * v * by[4];
      const double weight = first * (u * by[0] + v * by[1]) + second * curving;
      add(n, weight);
      total += weight;
    }
    add(m, -total);
  }

  const GridlineEnds& ends_;
  const layout::Topology& topology_;
  Array<double, 1> weight_;  // (M,) 0 between two points
  Array<std::int64_t, 1> markers_;
  Index count_ = 0;  // of the markers with a weight
};

}  // namespace

VirtualMarkers locate_on_edges(const LocatedMarkers& markers, const refine::MarkerScatter& scatter,
                               const layout::Topology& topology, View<const double, 3> points,
                               const VirtualLimits& limits) {
  const Index count = points.size(0), m = points.size(1);
  Array<double, 3> xy({count, m, 2}, NOT_A_NUMBER);
  Array<double, 4> cov({count, m, 2, 2}, NOT_A_NUMBER);
  Array<std::uint8_t, 2> status({count, m}, LOST);
  if (m == 0) return {std::move(xy), std::move(cov), std::move(status)};
  Array<bool, 1> known({markers.status.size()});
  for (Index k = 0; k < known.size(); ++k) known[k] = markers.status[k] != LOST;
  Array<double, 3> maps =
      refine::local_maps(markers.xy_px, topology.ring_markers, topology.ring_vectors,
                         topology.derivative_stencil, limits.gridlines);
  if (scatter.share > 0.0) refine::update_without_rim_curves(maps, topology.spokes);
  const GridlineEnds ends{markers.xy_px, markers.cov_px2, known, maps, scatter};
  MarkerWeights weights(ends, topology);
  for (Index e = 0; e < count; ++e) {
    const Index a = topology.edges(e, 0), b = topology.edges(e, 1);
    if (!(ends.known[a] && ends.known[b])) continue;
    const Gridline gridline(ends, topology, e, a, b);
    const double free_variance = ends.scatter.bend_variance(topology.scatter_bending[e]);
    const double limit_px = limits.max_measured_offset * gridline.length;
    for (Index j = 0; j < m; ++j) {
      const double t = static_cast<double>(j + 1) / static_cast<double>(m + 1);
      Located point = gridline.at(t, limits.bend_uncertainty, free_variance);
      gridline.update_to_measured(points[e][j], limit_px, point);
      if (point.status == INTERPOLATED && weights.is_by_stencil(a) && weights.is_by_stencil(b))
        weights.update_covariance(e, t, point);
      status(e, j) = point.status;
      xy(e, j, 0) = gridline.x0 + point.x;
      xy(e, j, 1) = gridline.y0 + point.y;
      cov(e, j, 0, 0) = point.xx;
      cov(e, j, 1, 1) = point.yy;
      cov(e, j, 0, 1) = cov(e, j, 1, 0) = point.cross;
    }
  }
  return {std::move(xy), std::move(cov), std::move(status)};
}

}  // namespace cmp::complete
