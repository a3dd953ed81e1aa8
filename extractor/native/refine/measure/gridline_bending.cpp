#include "refine/measure/gridline_bending.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "numeric/median.hpp"
#include "refine/measure/lane_sort.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
constexpr double INFINITE = std::numeric_limits<double>::infinity();

double squared(double x) { return x * x; }

// (E,) px^2, NaN where one of the four markers is not known.
Array<double, 1> squared_third_differences(View<const double, 2> xy, View<const double, 3> maps,
                                           const MarkerRows& rows) {
  Array<double, 1> out({rows.edges.size()}, NONE);
  for (Index e = 0; e < rows.edges.size(); ++e) {
    if (rows.next_markers(e, 0) < 0 || rows.next_markers(e, 1) < 0) continue;
    const auto [x, y] = third_difference(xy, maps, rows.edges, rows.next_markers, rows.third_differences, e);
    out[e] = x * x + y * y;
  }
  return out;
}

// The squared third differences at the markers.
struct MarkerDifferences {
  Array<double, 2> squares;  // (M, 6), NaN where unknown
  Array<double, 1> known,
      above;  // (M,) the numbers of known ones, and of those whose mean would exceed the noise
};

MarkerDifferences differences_at_markers(View<const double, 1> square, View<const std::int32_t, 2> spokes,
                                         double noise, const BendingLimits& limits) {
  MarkerDifferences out{Array<double, 2>({spokes.size(), spokes.size(1)}, NONE),
                        Array<double, 1>({spokes.size()}, 0.0), Array<double, 1>({spokes.size()}, 0.0)};
  const auto squares = out.squares.view();
  for (Index m = 0; m < spokes.size(); ++m) {
    for (Index k = 0; k < spokes.size(1); ++k) {
      const std::int32_t e = spokes(m, k);
      if (e < 0 || !(square[e] >= 0.0)) continue;
      squares(m, k) = square[e];
      out.known[m] += 1.0;
      out.above[m] += limits.mean_over_median * square[e] > noise ? 1.0 : 0.0;
    }
  }
  return out;
}

// Fills a lane with the squared third differences at marker m and at its neighbours.
void fill_lane(Index m, Index lane, View<const double, 2> squares, View<const std::int32_t, 2> near,
               LaneColumn& column) {
  Index missing = 0, row = 0;
  for (Index k = -1; k < FIRST_RING; ++k) {
    const Index n = k < 0 ? m : near(m, k);
    for (Index i = 0; i < layout::SPOKES; ++i, ++row) {
      double square = n >= 0 ? squares(n, i) : NONE;
      if (!(square >= 0.0)) {
        // missing ones lie on both sides of the median, half of them on each
        square = missing % 2 == 0 ? -INFINITE : INFINITE;
        ++missing;
      }
      column[row][lane] = static_cast<float>(square);
    }
  }
}

// The variance by noise, px^2, of a third difference between markers with these blocks (M, 3) of the
// information.
double third_difference_noise(View<const double, 2> diagonal, const BendingLimits& limits) {
  Array<double, 1> trace({diagonal.size()});
  Index count = 0;
  for (Index m = 0; m < diagonal.size(); ++m) {
    trace[count] = diagonal(m, 0) + diagonal(m, 2);
    count += !std::isnan(trace[count]);
  }
  // the median, as markers with little weight where gridlines bend must not be taken for noise
  return limits.third_difference_noise * 2.0 / numeric::median_of_many(trace.slice(0, count));
}

// The numbers of gridlines at a marker and at its neighbours, all and those above the noise.
struct NearbyCounts {
  double known, above;
};

NearbyCounts count_nearby(Index m, const MarkerDifferences& own, View<const std::int32_t, 2> near) {
  NearbyCounts out{own.known[m], own.above[m]};
  for (Index k = 0; k < FIRST_RING; ++k) {
    const std::int32_t n = near(m, k);
    if (n < 0) continue;
    out.known += own.known[n];
    out.above += own.above[n];
  }
  return out;
}

}  // namespace

Array<double, 1> measure_roughness(View<const double, 2> xy, View<const double, 3> maps,
                                   View<const double, 2> diagonal, const MarkerRows& rows,
                                   View<const std::int32_t, 2> spokes, View<const std::int32_t, 2> near,
                                   const BendingLimits& limits) {
  const double noise = third_difference_noise(diagonal, limits);
  const auto own = differences_at_markers(squared_third_differences(xy, maps, rows), spokes, noise, limits);
  Array<double, 1> out({spokes.size()}, 0.0);
  LaneColumn column;
  std::array<Index, SORT_LANES> marker;
  std::array<bool, SORT_LANES> is_odd;
  Index filled = 0;
  for (Index m = 0; m < spokes.size(); ++m) {
    const auto [known, above] = count_nearby(m, own, near);
    if (2.0 * above > known) {
      fill_lane(m, filled, own.squares, near, column);
      marker[filled] = m;
      is_odd[filled] = std::fmod(known, 2.0) == 1.0;
      ++filled;
    }
    if (filled < SORT_LANES && (filled == 0 || m < spokes.size() - 1)) continue;
    column.sort();
    for (Index k = 0; k < filled; ++k) {
      const float lower = column[SORT_ROWS / 2 - 1][k], upper = column[SORT_ROWS / 2][k];
      const auto middle = static_cast<double>(is_odd[k] ? upper : 0.5F * (lower + upper));
      out[marker[k]] = std::max(limits.mean_over_median * middle - noise, 0.0);
    }
    filled = 0;
  }
  return out;
}

Array<bool, 1> bending_gridlines(View<const double, 1> roughness, View<const double, 2> bend,
                                 View<const std::int32_t, 2> edges) {
  Array<bool, 1> out({edges.size()});
  for (Index e = 0; e < edges.size(); ++e) {
    const bool bends = bend(e, 0) != 0.0 || bend(e, 1) != 0.0;
    out[e] = bends || roughness[edges(e, 0)] > 0.0 || roughness[edges(e, 1)] > 0.0;
  }
  return out;
}

Array<double, 1> estimate_bend_variance(View<const double, 2> sums, const ShiftGradients& gradients,
                                        const BendingPrior& prior, View<const double, 2> lines,
                                        View<const std::int32_t, 2> edges, double variance,
                                        const BendingLimits& limits) {
  const Index count = prior.roughness.size();
  Array<double, 1> total({count}, 0.0), noise_total({count}, 0.0), known({count}, 0.0),
      out({edges.size()}, 0.0);
  for (Index e = 0; e < edges.size(); ++e) {
    const auto own = sums[e];
    const double aa = own[AA], ab = own[AB], bb = own[BB], ac = own[AC], bc = own[BC],
                 weight = prior.weight[e];
    const double determinant = aa * bb - ab * ab;
    if (!(determinant > limits.min_determinant_share * aa * bb)) continue;
    const double by_a = (bb * ac - ab * bc) / determinant, by_b = (aa * bc - ab * ac) / determinant;
    const double information = own[CC] - by_a * ac - by_b * bc;
    if (!(information > limits.min_information_share * own[CC])) continue;
    const double pull = own[C] - by_a * gradients.start[e] - by_b * gradients.end[e];
    const double b = prior.bend(e, 0) + pull / information;
    for (const std::int32_t m : edges[e]) {
      total[m] += weight * b * b;
      noise_total[m] += weight * variance / information;
      known[m] += weight;
    }
  }
  const double least = squared(limits.min_bend_share), most = squared(limits.max_bend_share);
  for (Index e = 0; e < edges.size(); ++e) {
    const std::int32_t i = edges(e, 0), j = edges(e, 1);
    const double square = std::min(prior.roughness[i], prior.roughness[j]), both = known[i] + known[j];
    if (!(square > 0.0 && both > 0.0)) continue;
    const double noise = (noise_total[i] + noise_total[j]) / both;
    const double excess =
        (total[i] + total[j]) / both - noise * (1.0 + limits.min_significance * std::sqrt(2.0 / both));
    const double by_scatter = prior.scatter.bend_variance(prior.scatter_bending[e]);
    const double limit = std::min(most * square, squared(limits.max_bend_deviation * lines(e, LENGTH)));
    out[e] = std::min(std::max({excess, least * square, by_scatter}), limit);
  }
  return out;
}

Array<double, 2> update_without_bending(View<double, 2> sums, ShiftGradients& gradients,
                                        View<const double, 2> bend, View<const double, 1> bend_variance,
                                        double variance) {
  Array<double, 2> response({sums.size(), RESPONSE_COLUMNS}, 0.0);
  for (Index e = 0; e < sums.size(); ++e) {
    const auto own = sums[e], out = response[e];
    own[READ_AA] = own[AA];
    own[READ_BB] = own[BB];
    out[HELD] = 1.0;
    if (own[AA] == 0.0) continue;
    const double c = own[C], d = own[D], ac = own[AC], ad = own[AD], bc = own[BC], bd = own[BD];
    double x = -bend(e, 0), y = -bend(e, 1);
    if (bend_variance[e] > 0.0) {
      const double stiff = variance / bend_variance[e];
      const double cc = own[CC] + stiff, cd = own[CD], dd = own[DD] + stiff;
      const double inverse = 1.0 / (cc * dd - cd * cd);
      const double pull_c = c + stiff * x, pull_d = d + stiff * y;
      x = (dd * pull_c - cd * pull_d) * inverse;
      y = (cc * pull_d - cd * pull_c) * inverse;
      out[2] = (dd * ac - cd * ad) * inverse;
      out[3] = (cc * ad - cd * ac) * inverse;
      out[4] = (dd * bc - cd * bd) * inverse;
      out[5] = (cc * bd - cd * bc) * inverse;
      out[HELD] = stiff / cc;
    }
    out[0] = x;
    out[1] = y;
    own[MISFIT] -= 2.0 * (x * c + y * d);
    own[MISFIT] += x * x * own[CC] + 2.0 * x * y * own[CD] + y * y * own[DD];
    gradients.start[e] -= ac * x + ad * y;
    gradients.end[e] -= bc * x + bd * y;
    own[AA] -= ac * out[2] + ad * out[3];
    own[AB] -= bc * out[2] + bd * out[3];
    own[BB] -= bc * out[4] + bd * out[5];
  }
  return response;
}

Array<double, 2> bend_after_shift(View<const double, 2> bend, View<const double, 2> response,
                                  View<const double, 2> shift, View<const double, 2> lines,
                                  View<const std::int32_t, 2> edges, const BendingLimits& limits) {
  Array<double, 2> out({bend.size(), 2}, 0.0);
  for (Index e = 0; e < bend.size(); ++e) {
    const auto line = lines[e], own = response[e];
    if (line[KNOWN] == 0.0) continue;
    const std::int32_t a = edges(e, 0), b = edges(e, 1);
    const double by_a = shift(a, 1) * line[UX] - shift(a, 0) * line[UY];
    const double by_b = shift(b, 1) * line[UX] - shift(b, 0) * line[UY];
    const double limit = limits.max_bend * line[LENGTH];
    for (Index k = 0; k < 2; ++k) {
      const double change = own[k] - own[2 + k] * by_a - own[4 + k] * by_b;
      out(e, k) = std::min(std::max(bend(e, k) + change, -limit), limit);
    }
  }
  return out;
}

Array<double, 1> bending_misfit(View<const double, 1> bend_variance, View<const double, 2> contrasts,
                                double sigma, const BendingLimits& limits) {
  Array<double, 1> out({bend_variance.size()});
  const double per_variance = limits.misfit_tolerance * squared(limits.bend_to_end_shift);
  const double most = limits.max_misfit_tolerance * sigma * sigma, root = std::sqrt(std::numbers::pi);
  for (Index e = 0; e < bend_variance.size(); ++e) {
    const auto own = contrasts[e];
    const double strength = squared(own[0]) + squared(own[1]) + squared(own[2]);
    // the mean of the squared normal density over the band to both sides
    const double share = strength / (3.0 * sigma * sigma) / (4.0 * limits.band * root);
    out[e] = std::min(per_variance * bend_variance[e], most) * share;
  }
  return out;
}

Array<double, 1> mean_at_markers(View<const double, 1> values, View<const std::int32_t, 2> spokes) {
  Array<double, 1> out({spokes.size()}, 0.0);
  for (Index m = 0; m < spokes.size(); ++m) {
    Index known = 0;
    for (const std::int32_t e : spokes[m]) {
      if (e < 0) continue;
      out[m] += values[e];
      ++known;
    }
    out[m] /= static_cast<double>(std::max<Index>(known, 1));
  }
  return out;
}

}  // namespace cmp::refine
