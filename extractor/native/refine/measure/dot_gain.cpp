#include "refine/measure/dot_gain.hpp"

#include <cmath>

#include "numeric/median.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// 1 where black lies on the side of gridline e's normal, -1 where on the other side, 0 where on neither.
double outward_sign(View<const double, 2> contrasts, View<const std::int32_t, 2> edge_cells, Index e) {
  if (edge_cells(e, 0) >= 0 && edge_cells(e, 1) >= 0) return 0.0;
  return contrasts(e, 0) + contrasts(e, 1) + contrasts(e, 2) > 0.0 ? 1.0 : -1.0;
}

struct Vector {
  double x, y;
};

// The unit vector from marker m to marker n.
Vector unit_vector(View<const double, 2> xy, Index m, Index n) {
  const double x = xy(n, 0) - xy(m, 0), y = xy(n, 1) - xy(m, 1);
  const double length = std::sqrt(x * x + y * y);
  return {x / length, y / length};
}

}  // namespace

double measure_dot_gain(View<const double, 2> sums, const ShiftGradients& gradients,
                        View<const double, 2> contrasts, View<const std::int32_t, 2> edge_cells, double sigma,
                        const DotGainLimits& limits) {
  Array<std::int64_t, 1> read({sums.size()});
  Index read_count = 0;
  for (Index e = 0; e < sums.size(); ++e) {
    if (sums(e, AA) > 0.0) read[read_count++] = e;
  }
  const Index every = std::max<Index>(read_count / limits.max_gridlines, 1);
  Array<double, 1> off({read_count});
  Index count = 0;
  for (Index k = 0; k < read_count; k += every) {
    const Index e = read[k];
    const double outward = outward_sign(contrasts, edge_cells, e);
    if (outward == 0.0) continue;
    const double gradient = gradients.start[e] + gradients.end[e];
    off[count++] = outward * gradient / (sums(e, AA) + 2.0 * sums(e, AB) + sums(e, BB));
  }
  const double dot_gain = count > limits.min_gridlines ? numeric::median_of_many(off.slice(0, count)) : 0.0;
  return std::abs(dot_gain) > limits.min_dot_gain * sigma ? dot_gain : 0.0;
}

Array<double, 1> update_without_dot_gain(View<double, 2> sums, ShiftGradients& gradients,
                                         View<const double, 2> contrasts,
                                         View<const std::int32_t, 2> edge_cells, double dot_gain) {
  Array<double, 1> shift({sums.size()}, 0.0);
  if (dot_gain == 0.0) return shift;
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e];
    if (own[AA] == 0.0) continue;
    const double off = dot_gain * outward_sign(contrasts, edge_cells, e);
    const double by_a = own[AA] + own[AB], by_b = own[AB] + own[BB];
    double &start = gradients.start[e], &end = gradients.end[e];
    own[MISFIT] -= off * (2.0 * (start + end) - off * (by_a + by_b));
    start -= off * by_a;
    end -= off * by_b;
    own[C] -= off * (own[AC] + own[BC]);
    own[D] -= off * (own[AD] + own[BD]);
    shift[e] = off;
  }
  return shift;
}

Array<double, 2> markers_without_dot_gain(View<const double, 2> xy, View<const std::int32_t, 2> cells,
                                          double dot_gain, const DotGainLimits& limits) {
  Array<double, 2> inward({xy.size(), 2}, 0.0);
  Array<double, 1> count({xy.size()}, 0.0);
  for (Index i = 0; i < cells.size(); ++i) {
    for (Index k = 0; k < 3; ++k) {
      const Index m = cells(i, k);
      const Vector a = unit_vector(xy, m, cells(i, (k + 1) % 3)),
                   b = unit_vector(xy, m, cells(i, (k + 2) % 3));
      const double sine = std::abs(a.x * b.y - a.y * b.x);
      if (!std::isfinite(sine)) continue;
      inward(m, 0) += dot_gain * (a.x + b.x) / std::max(sine, limits.min_sine);
      inward(m, 1) += dot_gain * (a.y + b.y) / std::max(sine, limits.min_sine);
      count[m] += 1.0;
    }
  }
  for (Index m = 0; m < xy.size(); ++m) {
    for (Index axis = 0; axis < 2; ++axis)
      inward(m, axis) = xy(m, axis) + inward(m, axis) / std::max(count[m], 1.0);
  }
  return inward;
}

}  // namespace cmp::refine
