#include "localmap/neighbour_prediction.hpp"

#include <cmath>
#include <limits>

#include "localmap/local_map.hpp"

namespace cmp::localmap {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();

// The markers of a table row (K,) at a known place (M, 2).
template <class Visit>
void for_known(View<const double, 2> xy_px, View<const std::int32_t, 1> row, Visit visit) {
  for (const std::int32_t j : row)
    if (j >= 0 && !std::isnan(xy_px(j, 0))) visit(j);
}

}  // namespace

MarkerPredictions predict_markers(View<const double, 2> xy_px, View<const double, 1> noise_px2,
                                  View<const bool, 1> wanted, View<const double, 2> marker_mm,
                                  View<const std::int32_t, 2> table, const NeighbourMapLimits& limits) {
  const Index count = xy_px.size();
  const auto unknown = [count] { return Array<double, 1>({count}, NOWHERE); };
  MarkerPredictions out{Array<double, 2>({count, 2}, NOWHERE), unknown(), unknown(), unknown(), unknown(),
                        Array<std::int32_t, 1>({count}, 0)};
  for (Index m = 0; m < count; ++m) {
    if (!wanted[m]) continue;
    const double x = marker_mm(m, 0), y = marker_mm(m, 1);
    double distance = 0.0, noise = 0.0;
    Index n = 0, first = -1;
    for_known(xy_px, table[m], [&](Index j) {
      distance += std::hypot(marker_mm(j, 0) - x, marker_mm(j, 1) - y);
      noise += noise_px2[j];
      first = j;
      ++n;
    });
    out.neighbour_count[m] = static_cast<std::int32_t>(n);
    if (n < limits.min_linear_neighbours) continue;
    const bool is_quadratic = n >= limits.min_quadratic_neighbours;
    LocalMap<2> map({x, y, distance / static_cast<double>(n), xy_px(first, 0), xy_px(first, 1), 1.0});
    for_known(xy_px, table[m],
              [&](Index j) { map.add(marker_mm(j, 0), marker_mm(j, 1), xy_px(j, 0), xy_px(j, 1)); });
    const double ridge = is_quadratic ? 0.0 : RIGID;
    if (!map.solve({.square = ridge, .mixed = ridge}, limits.min_spread)) continue;
    const auto influence = map.influence(x, y);
    double own_noise = 0.0;
    for_known(xy_px, table[m], [&](Index j) {
      const double weight = map.product(influence, map.terms(marker_mm(j, 0), marker_mm(j, 1)));
      own_noise += weight * weight * noise_px2[j];
    });
    const auto [x_px, y_px] = map.at(x, y);
    out.xy_px(m, 0) = x_px;
    out.xy_px(m, 1) = y_px;
    out.leverage[m] = influence[0];
    const Index terms = is_quadratic ? LocalMap<2>::TERMS : LocalMap<1>::TERMS;
    out.variance_px2[m] =
        std::max(map.misfit(), 0.0) / (2.0 * static_cast<double>(std::max<Index>(n - terms, 1)));
    out.noise_px2[m] = own_noise;
    out.neighbour_noise_px2[m] = noise / static_cast<double>(n);
  }
  return out;
}

}  // namespace cmp::localmap
