#include "complete/consistency_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "localmap/neighbour_prediction.hpp"

namespace cmp::complete {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr double UNBOUNDED = std::numeric_limits<double>::infinity();

using layout::RingTables;
using Edges = View<const double, 1>;

// The smaller of the edge at marker m and the distance to its nearest known neighbour, px.
//
// A tolerance in units of a longer edge might reach half-way to another marker.
double shortest_edge(View<const double, 2> xy, Index m, View<const std::int32_t, 2> first_ring,
                     double edge_px) {
  for (Index k = 0; k < first_ring.size(1); ++k) {
    const Index n = first_ring(m, k);
    if (n < 0) continue;
    const double distance = std::hypot(xy(n, 0) - xy(m, 0), xy(n, 1) - xy(m, 1));
    if (distance < edge_px) edge_px = distance;
  }
  return edge_px;
}

// Whether every marker of the pattern is known and no rule could drop one, which is the usual case.
bool is_consistent(View<const double, 2> xy, Edges tolerance_px, const RingTables& tables,
                   const ImageSize& size) {
  for (Index m = 0; m < xy.size(); ++m) {
    const double x = xy(m, 0), y = xy(m, 1);
    if (std::isnan(x)) {
      if (tables.present[m]) return false;
      continue;
    }
    if (!is_inside_image(x, y, size)) return false;
    if (localmap::is_neighbour_outlier(xy, m, tolerance_px[m], tables.ring_weights, tables.neighbours))
      return false;
  }
  return true;
}

// The distance of a marker from its prediction over the allowed distance.
//
// It is infinite where neither triangles nor neighbours confirm the marker, or the prediction is too
// uncertain. The allowed distance is smaller where synthesis does not explain the image; the neighbours must
// then be known.
//
// distance: from the prediction, px; sigma: standard deviation of the prediction, px.
double misfit_ratio(Index m, double distance, double sigma, const MarkerEvidence& evidence,
                    const ConsistencyLimits& limits) {
  const double edge_px = evidence.edge_px[m];
  const bool explained = evidence.explained[m], agreed = evidence.agreed[m],
             is_intact = evidence.is_intact[m];
  const bool confirmed = explained || agreed;
  const double allowed = confirmed ? limits.max_distance : limits.max_unexplained_distance;
  const double max_deviation = confirmed ? limits.max_predicted_deviation : limits.max_unexplained_distance;
  if (!(explained || is_intact || sigma < max_deviation * edge_px)) return UNBOUNDED;
  const double ratio = distance / (edge_px * allowed);
  if (std::isfinite(ratio)) return ratio;
  return agreed ? 0.0 : UNBOUNDED;
}

// The rejection of markers that do not lie where their neighbours put them, the worst of each neighbourhood
// first.
class Rejection {
 public:
  Rejection(View<double, 2> xy, View<double, 3> cov, const MarkerEvidence& evidence, const RingTables& tables,
            const ConsistencyLimits& limits)
      : xy_(xy),
        cov_(cov),
        evidence_(evidence),
        tables_(tables),
        limits_(limits),
        misfit_({xy.size()}, 0.0),
        doubtful_({xy.size()}, false),
        no_noise_({xy.size()}, 0.0) {}

  void run(Edges tolerance_px) {
    std::vector<Index> pending(static_cast<std::size_t>(xy_.size()));
    for (Index m = 0; m < xy_.size(); ++m) pending[m] = m;
    for (std::int64_t round = 0; round < limits_.max_rounds; ++round) {
      // only markers beyond the tolerance are predicted, again where a neighbour has been dropped
      doubtful_.fill(false);
      for (Index m : pending) {
        misfit_[m] = 0.0;
        doubtful_[m] =
            !std::isnan(xy_(m, 0)) &&
            localmap::is_neighbour_outlier(xy_, m, tolerance_px[m], tables_.ring_weights, tables_.neighbours);
      }
      update_misfit();
      const auto worst = worst_markers();
      if (worst.empty()) break;
      pending = drop(worst);
    }
  }

 private:
  void update_misfit() {
    const auto predicted = localmap::predict_markers(xy_, no_noise_, doubtful_, tables_.marker_mm,
                                                     tables_.neighbours, limits_.maps);
    for (Index m = 0; m < xy_.size(); ++m) {
      if (!doubtful_[m]) continue;
      const double distance =
          std::hypot(xy_(m, 0) - predicted.xy_px(m, 0), xy_(m, 1) - predicted.xy_px(m, 1));
      const double sigma = std::sqrt(predicted.variance_px2[m] * (1 + predicted.leverage[m]));
      misfit_[m] = misfit_ratio(m, distance, sigma, evidence_, limits_);
    }
  }

  // the markers that fit worse than all their neighbours
  std::vector<Index> worst_markers() const {
    std::vector<Index> worst;
    for (Index m = 0; m < xy_.size(); ++m) {
      if (!(misfit_[m] > 1.0)) continue;
      const auto neighbours = tables_.neighbours[m];
      if (std::all_of(neighbours.begin(), neighbours.end(),
                      [&](Index n) { return n < 0 || misfit_[m] >= misfit_[n]; }))
        worst.push_back(m);
    }
    return worst;
  }

  // sets markers to NaN; these and their neighbours
  std::vector<Index> drop(const std::vector<Index>& markers) {
    Array<bool, 1> affected({xy_.size()}, false);
    for (Index m : markers) {
      xy_[m].fill(NOT_A_NUMBER);
      cov_[m].fill(NOT_A_NUMBER);
      affected[m] = true;
      for (Index n : tables_.neighbours[m])
        if (n >= 0) affected[n] = true;
    }
    std::vector<Index> found;
    for (Index m = 0; m < xy_.size(); ++m)
      if (affected[m]) found.push_back(m);
    return found;
  }

  View<double, 2> xy_;
  View<double, 3> cov_;
  const MarkerEvidence& evidence_;
  const RingTables& tables_;
  const ConsistencyLimits& limits_;
  Array<double, 1> misfit_;
  Array<bool, 1> doubtful_;
  Array<double, 1> no_noise_;
};

}  // namespace

ConsistentEdges update_rejecting_inconsistent(View<double, 2> xy, View<double, 3> cov,
                                              const MarkerEvidence& evidence, const RingTables& tables,
                                              const ImageSize& size, const ConsistencyLimits& limits) {
  const auto count = xy.size();
  Array<double, 1> edge_px(evidence.edge_px), tolerance_px({count});
  for (Index m = 0; m < count; ++m) {
    const bool agreed = evidence.agreed[m];
    if (!agreed) edge_px[m] = shortest_edge(xy, m, tables.first_ring, edge_px[m]);
    tolerance_px[m] = evidence.explained[m] || agreed ? edge_px[m] * limits.max_distance : 0.0;
  }
  if (is_consistent(xy, tolerance_px, tables, size)) return {std::move(edge_px), true};
  const MarkerEvidence judged{evidence.explained, edge_px, evidence.agreed, evidence.is_intact};
  Rejection(xy, cov, judged, tables, limits).run(tolerance_px);
  return {std::move(edge_px), false};
}

}  // namespace cmp::complete
