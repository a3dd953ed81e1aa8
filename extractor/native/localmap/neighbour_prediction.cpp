#include "localmap/neighbour_prediction.hpp"

#include <cmath>
#include <limits>

#include "localmap/ring_maps.hpp"

namespace cmp::localmap {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();

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
    out.noise_px2[m] = maps.noise(lane);
    out.neighbour_noise_px2[m] = maps.summed_noise(lane) / static_cast<double>(out.neighbour_count[m]);
  }
}

}  // namespace

MarkerPredictions predict_markers(View<const double, 2> xy_px, View<const double, 1> noise_px2,
                                  View<const bool, 1> wanted, View<const double, 2> marker_mm,
                                  View<const std::int32_t, 2> table, const NeighbourMapLimits& limits) {
  const Index count = xy_px.size();
  const auto unknown = [count] { return Array<double, 1>({count}, NOWHERE); };
  MarkerPredictions out{Array<double, 2>({count, 2}, NOWHERE), unknown(), unknown(), unknown(), unknown(),
                        Array<std::int32_t, 1>({count}, 0)};
  RingMaps maps(table.size(1));
  std::array<Index, numeric::LANES> members;
  Index filled = 0;
  for (Index m = 0; m < count; ++m) {
    if (!wanted[m]) continue;
    const Index n = maps.fill_neighbours(xy_px, noise_px2, m, filled, marker_mm, table);
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

}  // namespace cmp::localmap
