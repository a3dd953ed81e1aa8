#include "refine/acceptance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "refine/measure/gridline_bending.hpp"

namespace cmp::refine {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

double squared(double value) { return value * value; }

// Makes marker m and its covariance unknown.
void update_to_unknown(View<double, 2> xy, View<double, 3> cov, Index m) {
  xy[m].fill(NOT_A_NUMBER);
  cov[m].fill(NOT_A_NUMBER);
}

// Adds a variance, px^2, in all directions to the covariance of marker m.
void add_variance(View<double, 3> cov, Index m, double variance) {
  cov(m, 0, 0) += variance;
  cov(m, 1, 1) += variance;
}

// Adds the variance by dirt to the covariances (M, 2, 2) px^2: dirt on some gridlines moves the others, too.
//
// weight (E,) 0 to 1, of the gridlines, 0 where nothing was measured; spokes (M, 6); edge (M,) px, the length
// of the edges at each marker.
void add_dirt_variance(View<double, 3> cov, View<const double, 1> weight, View<const std::int32_t, 2> spokes,
                       View<const double, 1> edge, const HiddenMarkerLimits& limits) {
  for (Index m = 0; m < cov.size(); ++m) {
    double missing = 0.0;
    Index count = 0;
    for (Index k = 0; k < spokes.size(1); ++k) {
      const std::int32_t e = spokes(m, k);
      if (e >= 0 && weight[e] > 0.0) {
        missing += 1.0 - weight[e];
        ++count;
      }
    }
    const auto divisor = static_cast<double>(std::max<Index>(count, 1));
    add_variance(cov, m, squared(limits.dirt_deviation * edge[m] * missing / divisor));
  }
}

// Markers (M, 2) px far from their start become NaN, as the drawing does not explain the image.
void update_unexplained_markers(View<double, 2> xy, View<double, 3> cov, const StartPlaces& places,
                                double dot_gain, const HiddenMarkerLimits& limits) {
  for (Index m = 0; m < xy.size(); ++m) {
    const double dx = xy(m, 0) - places.xy_px(m, 0), dy = xy(m, 1) - places.xy_px(m, 1);
    const double limit =
        limits.max_shift_unexplained * places.edge_px[m] + limits.dot_gain_factor * std::abs(dot_gain);
    if (std::sqrt(dx * dx + dy * dy) > limit) update_to_unknown(xy, cov, m);
  }
}

}  // namespace

AcceptedMarkers accepted_markers(View<const double, 2> measured, const Information& information,
                                 View<const double, 1> bend_variance, View<const std::int32_t, 2> edges,
                                 View<const std::int32_t, 2> spokes, const StartPlaces& places,
                                 View<const bool, 1> selected, const AcceptanceLimits& limits) {
  Array<double, 2> out(measured);
  const Array<double, 1> bending = mean_at_markers(bend_variance, spokes);
  Array<double, 3> out_cov = covariances(information.diagonal, information.off_diagonal, edges, spokes,
                                         limits.min_information, selected, limits.information);
  const auto xy = out.view();
  const auto cov = out_cov.view();
  const auto start = places.xy_px;
  const auto edge = places.edge_px;
  for (Index m = 0; m < xy.size(); ++m) {
    const double dx = xy(m, 0) - start(m, 0), dy = xy(m, 1) - start(m, 1);
    const double limit = (places.is_intact[m] ? limits.max_shift_all_cells : limits.max_shift) * edge[m];
    add_variance(cov, m, squared(limits.bend_to_end_shift) * bending[m]);
    const double spread = cov(m, 0, 0) + cov(m, 1, 1);
    const bool is_accepted =
        dx * dx + dy * dy < limit * limit && spread < squared(limits.max_deviation * edge[m]);
    if (!is_accepted) update_to_unknown(xy, cov, m);
  }
  return {std::move(out), std::move(out_cov)};
}

FinalMarkers accept_markers(const SolvedMarkers& solved, const StartPlaces& places,
                            const layout::Topology& topology, const FinalLimits& limits) {
  const Array<bool, 1> every({solved.measured.size()}, true);
  auto [xy, cov] = accepted_markers(solved.measured, solved.information, solved.bend_variance, topology.edges,
                                    topology.spokes, places, every, limits.acceptance);
  add_dirt_variance(cov, solved.weight, topology.spokes, places.edge_px, limits.hidden);
  const auto remaining = solved.convergence_cov_px2.flat();
  const auto variances = cov.flat();
  for (Index k = 0; k < variances.size(); ++k) variances[k] += remaining[k];
  if (solved.noise > limits.unexplained_noise_ratio * solved.pixel_noise)
    update_unexplained_markers(xy, cov, places, solved.dot_gain, limits.hidden);
  Array<bool, 1> unaccepted({every.size()}, false);
  for (Index m = 0; m < every.size(); ++m)
    unaccepted[m] =
        (std::isnan(xy(m, 0)) || std::isnan(solved.reliable(m, 0))) && std::isfinite(places.xy_px(m, 0));
  const bool all_accepted = std::find(unaccepted.begin(), unaccepted.end(), true) == unaccepted.end();
  return {std::move(xy), std::move(cov), std::move(unaccepted), all_accepted};
}

Array<bool, 1> update_lost_markers(View<double, 2> xy, View<double, 3> cov, View<const bool, 1> unaccepted,
                                   View<const double, 2> predicted, View<const double, 2> start,
                                   View<const double, 1> edge, const HiddenMarkerLimits& limits) {
  Array<bool, 1> out({xy.size()}, false);
  for (Index m = 0; m < xy.size(); ++m) {
    if (!unaccepted[m]) continue;
    const double dx = xy(m, 0) - predicted(m, 0), dy = xy(m, 1) - predicted(m, 1);
    const bool is_near = dx * dx + dy * dy < squared(limits.max_shift_from_prediction * edge[m]);
    if (!is_near) update_to_unknown(xy, cov, m);
    out[m] = std::isnan(xy(m, 0)) && std::isfinite(start(m, 0));
  }
  return out;
}

void update_obstructed_markers(View<double, 2> xy, View<double, 3> cov, View<const bool, 1> selected,
                               const StartPlaces& places, const HiddenMarkerLimits& limits) {
  const auto start = places.xy_px;
  const auto edge = places.edge_px;
  for (Index m = 0; m < xy.size(); ++m) {
    if (!selected[m]) continue;
    const double dx = xy(m, 0) - start(m, 0), dy = xy(m, 1) - start(m, 1);
    const double distance = std::sqrt(dx * dx + dy * dy);
    if (!(distance < limits.max_place_error * edge[m])) {
      update_to_unknown(xy, cov, m);
      continue;
    }
    // all triangles around a marker are seldom wrong together: the larger the distance, the more they count
    const double ratio = distance / (limits.disagreement_scale * edge[m]);
    const double share = places.is_intact[m] ? 0.5 / (1.0 + ratio * ratio) : 0.5;
    xy(m, 0) = start(m, 0) + share * dx;
    xy(m, 1) = start(m, 1) + share * dy;
    add_variance(cov, m, 0.25 * squared(distance) + squared(limits.unexplained_deviation * edge[m]));
  }
}

}  // namespace cmp::refine
