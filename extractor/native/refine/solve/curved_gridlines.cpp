#include "refine/solve/curved_gridlines.hpp"

#include <cmath>
#include <limits>

#include "base/parts.hpp"
#include "refine/measure/gridline_bending.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// The integrals of a gridline's bending, t (1 - t) and t (1 - t) (1 - 2 t), with its straight lines, 1 - t
// and t, over that of the two straight lines: of a gridline with even contrast.
constexpr double BEND_SHARE = 0.5, SLANT_SHARE = 0.1;

// Along the normal of a gridline, px.
struct Normal {
  double x, y;

  Normal(View<const double, 2> lines, Index e) : x(-lines(e, UY)), y(lines(e, UX)) {}
  double of(double dx, double dy) const { return x * dx + y * dy; }
};

// The bending of a gridline: b of t (1 - t), s of t (1 - t) (1 - 2 t), px.
struct Bending {
  double b, s;
};

// The maps (M, 2, 5) of the shifts (M, 2), from the markers that the maps of the drawing use.
Array<double, 3> maps_of_shifts(const CurvedGridlines& curved, View<const double, 2> shift,
                                const GridlineLimits& limits) {
  const auto& topology = curved.topology;
  Array<double, 2> seen(shift);
  for (Index m = 0; m < shift.size(); ++m) {
    if (curved.hidden[m] || !std::isfinite(curved.xy(m, 0)))
      seen(m, 0) = seen(m, 1) = std::numeric_limits<double>::quiet_NaN();
  }
  Array<double, 3> maps =
      local_maps(seen, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil, limits);
  update_without_rim_curves(maps, topology.spokes);
  return maps;
}

// How the maps bend gridline e, whose chord turns by `turn` px; as gridlines has it.
Bending bending_by(View<const double, 3> maps, const layout::Topology& topology, Index e,
                   const Normal& normal, double turn, double scatter_share) {
  const double u = topology.edge_vectors(e, 0), v = topology.edge_vectors(e, 1);
  std::array<double, 2> slope, curvature;
  for (Index side = 0; side < 2; ++side) {
    const auto x = maps[topology.edges(e, side)][0], y = maps[topology.edges(e, side)][1];
    slope[side] = normal.of(u * x[0] + v * x[1], u * y[0] + v * y[1]) - turn;
    const double curve = normal.of(u * u * x[2] + 2.0 * u * v * x[3] + v * v * x[4],
                                   u * u * y[2] + 2.0 * u * v * y[3] + v * v * y[4]);
    curvature[side] = std::isfinite(curve) ? curve : 0.0;
  }
  const auto [leave, arrive] = EndSlopes(slope[0], slope[1], curvature[0], curvature[1], scatter_share);
  return {0.5 * (leave - arrive), 0.5 * (leave + arrive)};
}

}  // namespace

CurvedGradients curved_gradients(const GridlineSystem& system, const ShiftGradients& gradients,
                                 const CurvedGridlines& curved, View<const double, 2> shift,
                                 const GridlineLimits& limits) {
  const auto edges = system.edges;
  const Array<double, 3> maps = maps_of_shifts(curved, shift, limits);
  CurvedGradients out{gradients.copy(), gradients.copy()};
  const auto add = [&](Index e) {
    const auto sums = system.sums[e], own = system.curving[e];
    if (system.weight[e] * system.lines(e, KNOWN) == 0.0) return;
    const Index a = edges(e, 0), b = edges(e, 1);
    const Normal normal(system.lines, e);
    const double start = normal.of(shift(a, 0), shift(a, 1)), end = normal.of(shift(b, 0), shift(b, 1));
    const Bending all = bending_by(maps, curved.topology, e, normal, end - start, system.scatter_share);
    const double held = curved.bend_response(e, HELD), bend = held * all.b, slant = held * all.s;
    const bool has_sums = sums[CC] > 0.0;
    const double ac = has_sums ? sums[AC] : BEND_SHARE * sums[AB],
                 ad = has_sums ? sums[AD] : SLANT_SHARE * sums[AB];
    const double bc = has_sums ? sums[BC] : BEND_SHARE * sums[AB],
                 bd = has_sums ? sums[BD] : -SLANT_SHARE * sums[AB];
    out.left.start[e] -= ac * bend + ad * slant;
    out.left.end[e] -= bc * bend + bd * slant;
    out.others.start[e] = out.left.start[e] + own[0] * sums[AA] * start + own[2] * sums[AB] * end;
    out.others.end[e] = out.left.end[e] + own[1] * sums[BB] * end + own[2] * sums[AB] * start;
  };
  in_parts(edges.size(), edges.size(), [&](Index begin, Index end) {
    for (Index e = begin; e < end; ++e) add(e);
  });
  return out;
}

}  // namespace cmp::refine
