#include "refine/measure/dot_gain.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "numeric/dense_systems.hpp"
#include "numeric/median.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr double DEVIATION_OF_MEDIAN = 1.4826;  // of a normal variable, over its median distance. Derived.

// 1 where black lies on the side of gridline e's normal, -1 where on the other side, 0 where on neither.
double outward_sign(View<const double, 2> contrasts, View<const std::int32_t, 2> edge_cells, Index e) {
  if (edge_cells(e, 0) >= 0 && edge_cells(e, 1) >= 0) return 0.0;
  return contrasts(e, 0) + contrasts(e, 1) + contrasts(e, 2) > 0.0 ? 1.0 : -1.0;
}

// px, the shift of gridline e outward of its cell; `outward` is 1 or -1.
double outward_shift(View<const double, 2> sums, const ShiftGradients& gradients, Index e, double outward) {
  return outward * (gradients.start[e] + gradients.end[e]) / (sums(e, AA) + 2.0 * sums(e, AB) + sums(e, BB));
}

// A sum of 1, x, y and the distance of (x, y) from 0, each times a coefficient, by least squares.
class ConeFit {
 public:
  void add(double x, double y, double value) {
    const std::array<double, 4> terms{1.0, x, y, std::hypot(x, y)};
    for (Index i = 0; i < 4; ++i) {
      for (Index j = 0; j <= i; ++j) gram_(i, j) += terms[i] * terms[j];
      right_(0, i) += terms[i] * value;
    }
    squares_ += value * value;
    count_ += 1.0;
  }
  // Coefficient i squared, less its variance where `correlated` values are alike; 0 or more.
  std::array<double, 4> squares_beyond_noise(double correlated) {
    for (Index i = 0; i < 4; ++i) right_(1 + i, i) = 1.0;
    const Array<double, 2> sums(right_.view().slice(0, 1));
    std::array<double, 4> out{};
    if (!numeric::update_to_cholesky_solution(gram_, right_, 4)) return out;
    double left = squares_;
    for (Index i = 0; i < 4; ++i) left -= right_(0, i) * sums(0, i);
    const double variance = correlated * std::max(left, 0.0) / count_;
    for (Index i = 0; i < 4; ++i)
      out[i] = std::max(right_(0, i) * right_(0, i) - variance * right_(1 + i, i), 0.0);
    return out;
  }

 private:
  Array<double, 2> gram_ = Array<double, 2>({4, 4}, 0.0), right_ = Array<double, 2>({5, 4}, 0.0);
  double squares_ = 0.0, count_ = 0.0;
};

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
    off[count++] = outward_shift(sums, gradients, e, outward);
  }
  const double dot_gain = count > limits.min_gridlines ? numeric::median_of_many(off.slice(0, count)) : 0.0;
  return std::abs(dot_gain) > limits.min_dot_gain * sigma ? dot_gain : 0.0;
}

UnevenDotGain measure_uneven_dot_gain(View<const double, 2> sums, const ShiftGradients& gradients,
                                      View<const double, 2> contrasts, View<const double, 2> xy,
                                      const layout::Topology& topology, double width, double height,
                                      const DotGainLimits& limits) {
  const auto edges = topology.edges, spokes = topology.spokes;
  Array<double, 1> off({edges.size()});
  Array<std::int64_t, 1> inside({edges.size()});
  Index count = 0;
  for (Index e = 0; e < edges.size(); ++e) {
    const Index last = spokes.size(1) - 1;
    const double outward = outward_sign(contrasts, topology.edge_cells, e);
    const bool at_rim = spokes(edges(e, 0), last) < 0 || spokes(edges(e, 1), last) < 0;
    if (!(sums(e, AA) > 0.0) || outward == 0.0 || at_rim) continue;
    off[count] = outward_shift(sums, gradients, e, outward);
    inside[count++] = e;
  }
  if (count <= limits.min_gridlines) return {};
  const double middle = numeric::median_of_many(Array<double, 1>(off.slice(0, count)));
  Array<double, 1> apart({count});
  for (Index k = 0; k < count; ++k) apart[k] = std::abs(off[k] - middle);
  const double most = limits.max_deviations * DEVIATION_OF_MEDIAN * numeric::median_of_many(apart);
  ConeFit cone;
  for (Index k = 0; k < count; ++k) {
    const Index a = edges(inside[k], 0), b = edges(inside[k], 1);
    cone.add(0.5 * (xy(a, 0) + xy(b, 0) - width + 1.0), 0.5 * (xy(a, 1) + xy(b, 1) - height + 1.0),
             std::clamp(off[k], middle - most, middle + most));
  }
  const auto squares = cone.squares_beyond_noise(limits.correlated);
  return {std::sqrt(squares[3]), std::sqrt(squares[1] + squares[2])};
}

Array<double, 1> dot_gain_offsets(View<const double, 2> sums, View<const double, 2> contrasts,
                                  View<const std::int32_t, 2> edge_cells, double dot_gain) {
  Array<double, 1> out({sums.size()}, 0.0);
  if (dot_gain == 0.0) return out;
  for (Index e = 0; e < sums.size(); ++e) {
    if (sums(e, AA) != 0.0) out[e] = dot_gain * outward_sign(contrasts, edge_cells, e);
  }
  return out;
}

void update_without_offsets(View<double, 2> sums, ShiftGradients& gradients, View<const double, 1> offset) {
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e];
    const double off = offset[e];
    if (off == 0.0 || own[AA] == 0.0) continue;
    const double by_a = own[AA] + own[AB], by_b = own[AB] + own[BB];
    double &start = gradients.start[e], &end = gradients.end[e];
    own[MISFIT] -= off * (2.0 * (start + end) - off * (by_a + by_b));
    start -= off * by_a;
    end -= off * by_b;
    own[C] -= off * (own[AC] + own[BC]);
    own[D] -= off * (own[AD] + own[BD]);
  }
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
