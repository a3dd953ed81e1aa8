#include "refine/refiner.hpp"

#include <cmath>

namespace cmp::refine {

std::tuple<Array<double, 2>, Array<double, 3>> at_full_scale(View<const double, 2> xy,
                                                             View<const double, 3> cov,
                                                             const StartPlaces& places, double scale,
                                                             const FullScaleLimits& limits) {
  const auto start = places.xy_px;
  const double area = scale * scale;
  Array<double, 2> places_px(xy.shape());
  Array<double, 3> covariances(cov.shape());
  const auto out = places_px.view();
  const auto out_cov = covariances.view();
  for (Index m = 0; m < xy.size(); ++m) {
    const bool from_places = std::isnan(xy(m, 0)) && places.agreed[m] && std::isfinite(start(m, 0));
    for (Index axis = 0; axis < 2; ++axis) {
      out(m, axis) = ((from_places ? start(m, axis) : xy(m, axis)) + 0.5) * scale - 0.5;
      for (Index other = 0; other < 2; ++other) out_cov(m, axis, other) = area * cov(m, axis, other);
    }
    if (!from_places) continue;
    const double deviation = limits.agreed_deviation * places.edge_px[m];
    out_cov(m, 0, 0) = out_cov(m, 1, 1) = area * (deviation * deviation);
    out_cov(m, 0, 1) = out_cov(m, 1, 0) = 0.0;
  }
  return {std::move(places_px), std::move(covariances)};
}

}  // namespace cmp::refine
