#include "track/warm_tables.hpp"

#include <cmath>

namespace cmp::track {

Array<double, 2> predict_missing(View<const std::int32_t, 2> completion, View<const double, 2> weights,
                                 View<const double, 2> xy) {
  Array<double, 2> out(xy.shape());
  for (Index m = 0; m < xy.size(); ++m) {
    for (int axis = 0; axis < 2; ++axis) out(m, axis) = xy(m, axis);
  }
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
