#include "complete/uncertain_markers.hpp"

namespace cmp::complete {

UncertainMarkers find_uncertain_markers(View<const double, 3> cov, View<const double, 1> edge_px,
                                        const UncertainLimits& limits) {
  const auto count = edge_px.size();
  Array<bool, 1> uncertain({count});
  bool is_any = false;
  for (Index m = 0; m < count; ++m) {
    const double deviation = limits.deviation * edge_px[m];
    uncertain[m] = cov(m, 0, 0) + cov(m, 1, 1) > deviation * deviation;
    is_any |= uncertain[m];
  }
  return {std::move(uncertain), is_any};
}

void update_by_fusion(View<double, 1> xy, View<double, 2> cov, View<const double, 1> predicted,
                      double variance) {
  const double xx = cov(0, 0) + variance, cross = cov(0, 1), yy = cov(1, 1) + variance;
  const double determinant = xx * yy - cross * cross;
  const double dx = predicted[0] - xy[0], dy = predicted[1] - xy[1];
  const double a = (yy * dx - cross * dy) / determinant, b = (xx * dy - cross * dx) / determinant;
  xy[0] += cov(0, 0) * a + cov(0, 1) * b;
  xy[1] += cov(0, 1) * a + cov(1, 1) * b;
  const double factor = variance / determinant;
  const double own = cov(0, 0) * cov(1, 1) - cross * cross;
  cov(0, 0) = factor * (own + variance * cov(0, 0));
  cov(1, 1) = factor * (own + variance * cov(1, 1));
  cov(0, 1) = cov(1, 0) = factor * variance * cross;
}

}  // namespace cmp::complete
