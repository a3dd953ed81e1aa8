#include "refine/measure/gridline_weights.hpp"

#include <cmath>
#include <limits>

#include "numeric/median.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr double ENDS = 2.0;  // unknowns of a gridline
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

double squared(double x) { return x * x; }

double determinant_of(double aa, double ab, double bb, const GridlineWeightLimits& limits) {
  return std::max(aa * bb - ab * ab,
                  limits.min_determinant_share * squared(aa + bb) + limits.min_determinant);
}

// Whether the gridlines at marker m have enough weight (E,).
bool is_well_weighted(View<const double, 1> weight, View<const std::int32_t, 2> spokes, Index m,
                      const GridlineWeightLimits& limits) {
  double total = 0.0;
  Index count = 0;
  for (const std::int32_t e : spokes[m]) {
    if (e < 0) continue;
    total += weight[e];
    ++count;
  }
  return total > limits.min_marker_weight * static_cast<double>(count);
}

// The noise in gray levels, from the gridlines' misfits (E,), their weights (E,) and the median misfit; NaN
// where that is NaN.
double noise_from_misfits(View<const double, 1> misfit, View<const double, 1> weight, double median_misfit,
                          const GridlineWeightLimits& limits) {
  Array<double, 1> clean({misfit.size()});
  Index count = 0, known = 0;
  for (Index e = 0; e < misfit.size(); ++e) {
    if (!std::isfinite(misfit[e])) continue;
    ++known;
    if (weight[e] == 1.0) clean[count++] = misfit[e];
  }
  // dirt is not noise
  if (count > 0 && static_cast<double>(count) < limits.min_clean_share * static_cast<double>(known))
    return std::sqrt(std::max(numeric::median_of_many(clean.slice(0, count)), squared(limits.min_noise)));
  return std::sqrt(median_misfit);
}

}  // namespace

ShiftGradients shift_gradients(View<const double, 2> sums) {
  ShiftGradients out{Array<double, 1>({sums.size()}), Array<double, 1>({sums.size()})};
  for (Index e = 0; e < sums.size(); ++e) {
    out.start[e] = sums(e, A);
    out.end[e] = sums(e, B);
  }
  return out;
}

Array<double, 1> gridline_misfits(View<const double, 2> sums, const ShiftGradients& gradients, double values,
                                  double min_places, const GridlineWeightLimits& limits) {
  Array<double, 1> out({sums.size()}, NONE);
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e];
    if (own[PIXELS] <= min_places) continue;
    const double aa = own[AA], ab = own[AB], bb = own[BB];
    const double determinant = determinant_of(aa, ab, bb, limits);
    const double start = gradients.start[e], end = gradients.end[e];
    const double explained = (bb * squared(start) - 2.0 * ab * start * end + aa * squared(end)) / determinant;
    out[e] = std::max(own[MISFIT] - explained, 0.0) / (values * own[PIXELS] - ENDS);
  }
  return out;
}

Array<double, 1> misfit_weights(View<const double, 2> sums, View<const double, 1> misfit,
                                double median_misfit, View<const double, 1> tolerance, double values,
                                double default_weight, const GridlineWeightLimits& limits) {
  Array<double, 1> weight({sums.size()}, 0.0);
  for (Index e = 0; e < sums.size(); ++e) {
    if (std::isfinite(misfit[e])) {
      const double deviation = std::sqrt(2.0 / (values * sums(e, PIXELS) - ENDS));
      const double by_chance = median_misfit * (limits.chance_factor + limits.chance_deviations * deviation);
      const double limit = std::max(by_chance, tolerance[e]);
      weight[e] = squared(std::min(1.0, limit / std::max(misfit[e], limits.min_misfit)));
    } else {
      weight[e] = sums(e, AA) > 0.0 ? default_weight : 0.0;
    }
  }
  return weight;
}

double median_of_misfits(View<const double, 1> misfit, const GridlineWeightLimits& limits) {
  Array<double, 1> known({misfit.size()});
  Index count = 0;
  for (const double own : misfit) {
    if (std::isfinite(own)) known[count++] = own;
  }
  return count > 0 ? std::max(numeric::median_of_many(known.slice(0, count)), squared(limits.min_noise))
                   : NONE;
}

GridlineWeights weigh_gridlines(View<const double, 2> sums, const ShiftGradients& gradients,
                                View<const double, 1> tolerance, double values, double min_places,
                                double default_weight, const GridlineWeightLimits& limits) {
  const auto misfit = gridline_misfits(sums, gradients, values, min_places, limits);
  const double median_misfit = median_of_misfits(misfit, limits);
  auto weight = misfit_weights(sums, misfit, median_misfit, tolerance, values, default_weight, limits);
  const double noise = noise_from_misfits(misfit, weight, median_misfit, limits);
  return {std::move(weight), median_misfit, noise};
}

Array<bool, 1> well_weighted_markers(View<const double, 1> weight, View<const std::int32_t, 2> spokes,
                                     const GridlineWeightLimits& limits) {
  Array<bool, 1> out({spokes.size()});
  for (Index m = 0; m < spokes.size(); ++m) out[m] = is_well_weighted(weight, spokes, m, limits);
  return out;
}

double short_edge(View<const double, 2> xy, View<const std::int32_t, 2> edges, Index rarity) {
  Array<double, 1> squares({edges.size()});
  const auto own_squares = squares.view();
  Index count = 0;
  for (Index e = 0; e < edges.size(); ++e) {
    const std::int32_t a = edges(e, 0), b = edges(e, 1);
    const double dx = xy(b, 0) - xy(a, 0), dy = xy(b, 1) - xy(a, 1);
    own_squares[count] = dx * dx + dy * dy;
    count += std::isfinite(own_squares[count]);  // an unknown one is overwritten
  }
  return count == 0 ? 0.0 : std::sqrt(numeric::select(squares.slice(0, count), count / rarity));
}

double median_edge(View<const double, 2> xy, View<const std::int32_t, 2> edges,
                   const GridlineWeightLimits& limits) {
  return std::max(short_edge(xy, edges, 2), limits.min_edge_px);
}

double blur_change(View<const double, 2> sums, View<const double, 1> gridline_weight,
                   const GridlineWeightLimits& limits) {
  double curvature = 0.0, pull = 0.0;
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e];
    const double weight = gridline_weight[e];
    if (weight == 0.0 || own[AA] == 0.0) continue;
    const double aa = own[AA], ab = own[AB], bb = own[BB], az = own[A_BLUR], bz = own[B_BLUR];
    const double determinant = determinant_of(aa, ab, bb, limits);
    const double by_a = (bb * az - ab * bz) / determinant, by_b = (aa * bz - ab * az) / determinant;
    curvature += weight * (own[BLUR_CURVATURE] - by_a * az - by_b * bz);
    pull += weight * (own[BLUR] - by_a * own[A] - by_b * own[B]);
  }
  return curvature > 0.0 ? pull / curvature : 0.0;
}

double blur_after_step(double sigma, double change, const GridlineWeightLimits& limits) {
  const double most = limits.max_blur_change * sigma;
  return std::max(sigma + std::min(std::max(change, -limits.max_blur_change * sigma), most),
                  limits.min_sigma_px);
}

void update_for_blur(View<double, 2> sums, ShiftGradients& gradients, double change) {
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e];
    gradients.start[e] -= change * own[A_BLUR];
    gradients.end[e] -= change * own[B_BLUR];
    own[C] -= change * own[C_BLUR];
    own[D] -= change * own[D_BLUR];
    own[MISFIT] -= change * (2.0 * own[BLUR] - change * own[BLUR_CURVATURE]);
  }
}

Array<double, 1> least_information(View<const double, 2> sums, View<const double, 1> weight,
                                   View<const double, 2> lines, View<const std::int32_t, 2> edges,
                                   double variance, Index count) {
  Array<double, 1> xx({count}, 0.0), cross({count}, 0.0), yy({count}, 0.0), out({count});
  for (Index e = 0; e < edges.size(); ++e) {
    const double nx = -lines(e, UY), ny = lines(e, UX), factor = weight[e] * lines(e, KNOWN) / variance;
    for (Index side = 0; side < 2; ++side) {
      const std::int32_t m = edges(e, side);
      const double value = factor * sums(e, side == 0 ? READ_AA : READ_BB);
      xx[m] += value * nx * nx;
      cross[m] += value * nx * ny;
      yy[m] += value * ny * ny;
    }
  }
  for (Index m = 0; m < count; ++m)
    out[m] = 0.5 * (xx[m] + yy[m]) - std::sqrt(0.25 * squared(xx[m] - yy[m]) + squared(cross[m]));
  return out;
}

ShiftedMarkers markers_after_shift(View<const double, 2> xy, View<const double, 2> shift,
                                   View<const double, 1> information, View<const double, 1> weight,
                                   View<const std::int32_t, 2> spokes, const GridlineWeightLimits& limits) {
  const Index count = xy.size();
  ShiftedMarkers out{Array<double, 2>({count, 2}), Array<double, 2>({count, 2})};
  Array<double, 1> informed({count});
  Index known = 0;
  for (const double own : information) {
    if (own > limits.informed_factor / squared(limits.prior_hidden_px)) informed[known++] = own;
  }
  const double limit = known > 0
                           ? limits.min_information_share * numeric::median_of_many(informed.slice(0, known))
                           : std::numeric_limits<double>::infinity();
  const double at_rim = 1.0 / squared(limits.rim_deviation_px);
  for (Index m = 0; m < count; ++m) {
    bool is_weak = information[m] < limit;
    if (is_weak && spokes(m, spokes.size(1) - 1) < 0 && information[m] > at_rim)
      is_weak = !is_well_weighted(weight, spokes, m, limits);
    for (Index axis = 0; axis < 2; ++axis) {
      out.measured(m, axis) = xy(m, axis) + shift(m, axis);
      out.reliable(m, axis) = is_weak ? NONE : out.measured(m, axis);
    }
  }
  return out;
}

Array<std::int64_t, 1> pattern_box(View<const double, 2> xy, double margin, Index width, Index height) {
  constexpr double INFINITE = std::numeric_limits<double>::infinity();
  std::array<double, 2> low{INFINITE, INFINITE}, high{-INFINITE, -INFINITE};
  for (Index m = 0; m < xy.size(); ++m) {
    if (!std::isfinite(xy(m, 0))) continue;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      low[axis] = std::min(low[axis], xy(m, axis));
      high[axis] = std::max(high[axis], xy(m, axis));
    }
  }
  Array<std::int64_t, 1> box({4}, 0);
  if (!(low[0] <= high[0])) return box;
  const std::array<double, 2> size{static_cast<double>(width), static_cast<double>(height)};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double from = std::floor(low[axis] - margin), to = std::ceil(high[axis] + margin) + 1.0;
    const auto place = static_cast<Index>(axis);
    box[place] = static_cast<std::int64_t>(std::min(std::max(from, 0.0), size[axis]));
    box[2 + place] = static_cast<std::int64_t>(std::min(std::max(to, 0.0), size[axis]));
  }
  return box;
}

}  // namespace cmp::refine
