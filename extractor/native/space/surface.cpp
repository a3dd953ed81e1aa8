#include "space/surface.hpp"

#include <cmath>
#include <limits>

namespace cmp::space {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint8_t LOST = 0, INTERPOLATED = 2;  // VirtualStatus in extractor/result.py

bool is_finite(View<const double, 1> values) {
  for (double value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

// The shares of start, end, slope at the start and slope at the end in the cubic at a fraction, and their
// share without the slopes.
struct CubicShares {
  double start, end, leave, arrive;

  explicit CubicShares(double t)
      : start((1 + 2 * t) * (1 - t) * (1 - t)),
        end(t * t * (3 - 2 * t)),
        leave(t * (1 - t) * (1 - t)),
        arrive(-t * t * (1 - t)) {}
};

// The markers at the ends of an edge.
struct Ends {
  Index start, end;
  double leave[3], arrive[3];  // derivatives of the place by the fraction

  Ends(const SurfaceMarkers& markers, View<const std::int32_t, 1> edge, View<const double, 1> step)
      : start(edge[0]), end(edge[1]) {
    for (int i = 0; i < 3; ++i) {
      const double chord = markers.xyz_mm(end, i) - markers.xyz_mm(start, i);
      const auto slope = [&](Index id) {
        const double by = markers.slopes(id, i, 0) * step[0] + markers.slopes(id, i, 1) * step[1];
        return std::isfinite(by) ? by : chord;
      };
      leave[i] = slope(start);
      arrive[i] = slope(end);
    }
  }
};

void fill_point(const SurfaceMarkers& markers, const Ends& ends, double t, View<double, 1> xyz,
                View<double, 2> cov, View<double, 1> normal) {
  const CubicShares shares(t);
  double square = 0.0;
  for (int i = 0; i < 3; ++i) {
    xyz[i] = shares.start * markers.xyz_mm(ends.start, i) + shares.end * markers.xyz_mm(ends.end, i) +
             shares.leave * ends.leave[i] + shares.arrive * ends.arrive[i];
    for (int j = 0; j < 3; ++j)
      cov(i, j) = shares.start * shares.start * markers.cov_mm2(ends.start, i, j) +
                  shares.end * shares.end * markers.cov_mm2(ends.end, i, j);
    normal[i] = (1 - t) * markers.normals(ends.start, i) + t * markers.normals(ends.end, i);
    square += normal[i] * normal[i];
  }
  for (double& value : normal) value /= std::sqrt(square);
}

}  // namespace

Array<double, 3> gradients(View<const double, 3> weights, View<const std::int64_t, 2> around,
                           View<const double, 2> values) {
  const Index count = values.size(), axes = values.size(1);
  Array<double, 3> out({count, axes, 2}, NOT_A_NUMBER);
  for (Index m = 0; m < count; ++m) {
    const auto own = values[m];
    if (!is_finite(own)) continue;
    out[m].fill(0.0);
    for (Index k = 0; k < around.size(1); ++k) {
      const Index id = around(m, k);
      if (id < 0 || !is_finite(values[id])) continue;
      for (Index i = 0; i < axes; ++i)
        for (int by = 0; by < 2; ++by) out(m, i, by) += weights(m, by, k) * (values(id, i) - own[i]);
    }
  }
  return out;
}

SurfacePoints points_on_edges(const SurfaceMarkers& markers, View<const std::int32_t, 2> edges,
                              View<const double, 2> steps_mm, std::int64_t count) {
  const Index number = edges.size(), each = static_cast<Index>(count);
  SurfacePoints out{
      Array<double, 3>({number, each, 3}, NOT_A_NUMBER), Array<double, 4>({number, each, 3, 3}, NOT_A_NUMBER),
      Array<double, 3>({number, each, 3}, NOT_A_NUMBER), Array<std::uint8_t, 2>({number, each}, LOST)};
  for (Index e = 0; e < number; ++e) {
    if (!is_finite(markers.xyz_mm[edges(e, 0)]) || !is_finite(markers.xyz_mm[edges(e, 1)])) continue;
    const Ends ends(markers, edges[e], steps_mm[e]);
    out.status[e].fill(INTERPOLATED);
    for (Index j = 0; j < each; ++j) {
      const double t = static_cast<double>(j + 1) / static_cast<double>(each + 1);
      fill_point(markers, ends, t, out.xyz_mm[e][j], out.cov_mm2[e][j], out.normals[e][j]);
    }
  }
  return out;
}

}  // namespace cmp::space
