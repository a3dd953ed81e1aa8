#include "track/warm_tables.hpp"

#include <cmath>

namespace cmp::track {

Array<double, 3> corners_at(View<const double, 2> xy, View<const std::int32_t, 2> corners) {
  Array<double, 3> out({corners.size(), 3, 2});
  for (Index i = 0; i < corners.size(); ++i) {
    for (Index k = 0; k < 3; ++k) copy<double, 1>(xy[corners(i, k)], out[i][k]);
  }
  return out;
}

Array<double, 2> predict_missing(const WarmTables& tables, View<const double, 2> xy) {
  const auto completion = tables.completion;
  const auto weights = tables.completion_weights;
  Array<double, 2> out(xy);
  Array<double, 1> count({xy.size()}, 0.0);
  for (Index row = 0; row < completion.size(); ++row) {
    const std::int32_t d = completion(row, 3);
    if (std::isfinite(xy(d, 0))) continue;
    const std::int32_t a = completion(row, 0), b = completion(row, 1), c = completion(row, 2);
    if (!std::isfinite(xy(a, 0) + xy(b, 0) + xy(c, 0))) continue;
    if (count[d] == 0.0) out[d].fill(0.0);
    count[d] += 1.0;
    for (int axis = 0; axis < 2; ++axis)
      out(d, axis) +=
          weights(row, 0) * xy(a, axis) + weights(row, 1) * xy(b, axis) + weights(row, 2) * xy(c, axis);
  }
  for (Index m = 0; m < xy.size(); ++m) {
    if (count[m] <= 0.0) continue;
    out(m, 0) /= count[m];
    out(m, 1) /= count[m];
  }
  return out;
}

}  // namespace cmp::track
