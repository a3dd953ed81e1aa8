// Room "localmap" for Python.
#include "base/binding.hpp"

#include "localmap/neighbour_prediction.hpp"

namespace cmp::localmap {

namespace {

std::tuple<Array<double, 2>, Array<double, 1>, Array<double, 1>, Array<double, 1>, Array<double, 1>,
           Array<std::int32_t, 1>>
predict(View<const double, 2> xy_px, View<const double, 1> noise_px2, View<const bool, 1> wanted,
        View<const double, 2> marker_mm, View<const std::int32_t, 2> table,
        const NeighbourMapLimits& limits) {
  auto found = predict_markers(xy_px, noise_px2, wanted, marker_mm, table, limits);
  return {std::move(found.xy_px),     std::move(found.variance_px2),        std::move(found.leverage),
          std::move(found.noise_px2), std::move(found.neighbour_noise_px2), std::move(found.neighbour_count)};
}

}  // namespace

void add_localmap(nb::module_ module) {
  bind<&predict>(module, "predict_markers", {"xy_px", "noise_px2", "wanted", "marker_mm", "table", "limits"});
}

}  // namespace cmp::localmap
