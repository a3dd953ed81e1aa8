#include "complete/repair.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "complete/uncertain_markers.hpp"
#include "localmap/neighbour_prediction.hpp"

namespace cmp::complete {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

using layout::RingTables;
using localmap::MarkerPredictions;
using Flags = Array<bool, 1>;

double square(double x) { return x * x; }

bool is_any(const Flags& flags) {
  const auto all = flags.view();
  return std::any_of(all.begin(), all.end(), [](bool one) { return one; });
}

// The edge at each marker; where it is NaN, the mean of the neighbours' edges, or NaN without any.
Array<double, 1> interpolated_edges(View<const double, 1> edge_px, View<const std::int32_t, 2> neighbours) {
  Array<double, 1> out(edge_px);
  for (Index m = 0; m < edge_px.size(); ++m) {
    if (!std::isnan(edge_px[m])) continue;
    double total = 0.0, count = 0.0;
    for (Index n : neighbours[m]) {
      if (n < 0 || std::isnan(edge_px[n])) continue;
      total += edge_px[n];
      count += 1.0;
    }
    out[m] = count > 0.0 ? total / count : NOT_A_NUMBER;
  }
  return out;
}

// The variance of a lost marker's place by the two rings around it, px^2; NaN where the place is not safe.
//
// What the neighbours' noise does not explain of their misfit is the surface's departure from the map; seen
// is the same as predictions of measured markers around show it, px^2.
double variance_by_neighbours(Index m, const MarkerPredictions& rings, double seen, double edge_px,
                              const RepairLimits& limits) {
  const double variance = rings.variance_px2[m], leverage = rings.leverage[m];
  const double upper_bound = variance * (1 + leverage) + square(limits.model_deviation * edge_px);
  if (rings.neighbour_count[m] < limits.mild_support ||
      !(leverage < limits.max_leverage && upper_bound < square(limits.max_repaired_deviation * edge_px)))
    return NOT_A_NUMBER;
  const double departure = std::max(variance - rings.neighbour_noise_px2[m], 0.0);
  const double found =
      rings.noise_px2[m] + std::max(square(limits.mild_error * leverage) * departure, seen * (1 + leverage));
  return found < square(limits.max_repaired_deviation * edge_px) ? found : NOT_A_NUMBER;
}

// A sum of departures from predictions, px^2, and their number.
struct Departures {
  double sum = 0.0, count = 0.0;

  void add(const Departures& other, double weight = 1.0) {
    sum += weight * other.sum;
    count += weight * other.count;
  }
};

// The same by the quadratic through the marker's layer, px^2.
double variance_by_layer(Index m, const LayerPrediction& found, double seen, double edge_px,
                         const RepairLimits& limits) {
  if (!(found.misfit_px2[m] + square(limits.fitted_model_sigmas * limits.model_deviation * edge_px) <
        square(limits.max_fitted_deviation * edge_px)))
    return NOT_A_NUMBER;
  const double variance = found.variance_px2[m] + seen;
  return variance < square(limits.max_repaired_deviation * edge_px) ? variance : NOT_A_NUMBER;
}

// M markers before repair.
struct UnrepairedMarkers {
  View<double, 2> xy_px;          // (M, 2) NaN where lost; written
  View<double, 3> cov_px2;        // (M, 2, 2) NaN where lost; written
  View<const bool, 1> uncertain;  // (M,)
  View<const double, 1> edge_px;  // (M,) edge at each marker
};

// The repair of the lost markers and the fusion of the uncertain ones.
class Repair {
 public:
  Repair(const UnrepairedMarkers& markers, const RefinedMarkers& refined, const RingTables& tables,
         const ImageSize& size, const RepairLimits& limits)
      : xy_(markers.xy_px),
        cov_(markers.cov_px2),
        markers_(markers),
        refined_(refined),
        tables_(tables),
        size_(size),
        limits_(limits),
        count_(markers.xy_px.size()),
        edge_px_(interpolated_edges(markers.edge_px, tables.neighbours)),
        lost_({count_}),
        known_(View<const double, 2>(markers.xy_px)),
        status_({count_}) {}

  Array<std::uint8_t, 1> run() {
    Flags wanted({count_});
    for (Index m = 0; m < count_; ++m) {
      const bool is_lost = std::isnan(xy_(m, 0)), uncertain = markers_.uncertain[m];
      status_[m] = is_lost ? LOST : MEASURED;
      lost_[m] = is_lost && tables_.present[m];
      wanted[m] = lost_[m] || uncertain;
      if (uncertain) known_[m].fill(NOT_A_NUMBER);
    }
    fill_by_rings(wanted);
    add_fused_markers();
    if (is_any(lost_) && is_any(Flags(markers_.uncertain))) fill_by_rings(Flags(lost_.view()));
    if (is_any(lost_)) fill_by_layer();
    drop_outside();
    return std::move(status_);
  }

 private:
  // by two rings, of the wanted markers and of those around, NaN where unknown
  MarkerPredictions predictions(const Flags& wanted) const {
    Flags predicted(wanted.view());
    for (Index m = 0; m < count_; ++m) {
      if (!wanted[m]) continue;
      for (const Index n : tables_.neighbours[m])
        if (n >= 0) predicted[n] = true;
    }
    return localmap::predict_markers(known_, noise_px2(), predicted, tables_.marker_mm, tables_.neighbours,
                                     limits_.maps);
  }

  // The departure of a marker from its prediction beyond the noise of both; nothing where the marker is
  // uncertain, not measured or not explained. A measurement that was dropped counts, too.
  Departures departure_of(Index m, const MarkerPredictions& rings) const {
    const auto xy = refined_.xy_px[m];
    const auto cov = refined_.cov_px2[m];
    if (!refined_.explained[m] || markers_.uncertain[m] || !std::isfinite(xy[0] + rings.xy_px(m, 0)))
      return {};
    const double squares = square(xy[0] - rings.xy_px(m, 0)) + square(xy[1] - rings.xy_px(m, 1));
    const double noise = 0.5 * (cov(0, 0) + cov(1, 1)) + rings.noise_px2[m];
    return {(0.5 * squares - noise) / (1 + rings.leverage[m]), 1.0};
  }

  // (M,) px^2, the variance of departures around the wanted markers, which count beside those of the picture
  Array<double, 1> seen_departures(const MarkerPredictions& rings, const Flags& wanted) const {
    Array<Departures, 1> each({count_});
    Departures picture;
    for (Index m = 0; m < count_; ++m) {
      each[m] = departure_of(m, rings);
      if (!lost_[m]) picture.add(each[m]);
    }
    const double mean = picture.count > 0.0 ? std::max(picture.sum / picture.count, 0.0) : 0.0;
    Array<double, 1> seen({count_}, 0.0);
    for (Index m = 0; m < count_; ++m) {
      if (!wanted[m]) continue;
      Departures around{limits_.picture_departures * mean, limits_.picture_departures};
      if (lost_[m]) around.add(each[m], limits_.own_departures);
      for (const Index n : tables_.neighbours[m])
        if (n >= 0) around.add(each[n]);
      seen[m] = std::max(around.sum / around.count, 0.0);
    }
    return seen;
  }

  // (M,) the markers' variances per axis, NaN where unknown
  Array<double, 1> noise_px2() const {
    Array<double, 1> out({count_});
    for (Index m = 0; m < count_; ++m) out[m] = 0.5 * (cov_(m, 0, 0) + cov_(m, 1, 1));
    return out;
  }

  // writes a marker's place and isotropic covariance; false if the variance is NaN or the place not in the
  // image
  bool fill(Index m, View<const double, 1> place, double variance) {
    xy_(m, 0) = place[0];
    xy_(m, 1) = place[1];
    cov_(m, 0, 0) = cov_(m, 1, 1) = variance;
    cov_(m, 0, 1) = cov_(m, 1, 0) = 0.0;
    return variance >= 0.0 && is_inside_image(place[0], place[1], size_);
  }

  void fill_by_rings(const Flags& wanted) {
    const MarkerPredictions rings = predictions(wanted);
    const Array<double, 1> seen = seen_departures(rings, wanted);
    for (Index m = 0; m < count_; ++m) {
      if (!wanted[m]) continue;
      const double variance = variance_by_neighbours(m, rings, seen[m], edge_px_[m], limits_);
      const auto place = rings.xy_px[m];
      if (lost_[m]) {
        lost_[m] = !fill(m, place, variance);
        status_[m] = REPAIRED;
      } else if (variance >= 0.0) {
        update_by_fusion(xy_[m], cov_[m], place, variance);
      }
    }
  }

  void add_fused_markers() {
    for (Index m = 0; m < count_; ++m) {
      if (!markers_.uncertain[m]) continue;
      known_(m, 0) = xy_(m, 0);
      known_(m, 1) = xy_(m, 1);
    }
  }

  // the weakest and slowest prediction, only for the remaining markers
  void fill_by_layer() {
    const LayerPrediction found = predict_by_layer(known_, noise_px2(), tables_.layers, limits_.layers);
    const Array<double, 1> seen = seen_departures(predictions(lost_), lost_);
    for (Index m = 0; m < count_; ++m) {
      if (!lost_[m]) continue;
      status_[m] = FITTED;
      fill(m, found.xy_px[m], variance_by_layer(m, found, seen[m], edge_px_[m], limits_));
    }
  }

  void drop_outside() {
    for (Index m = 0; m < count_; ++m) {
      if (cov_(m, 0, 0) >= 0.0 && is_inside_image(xy_(m, 0), xy_(m, 1), size_)) continue;
      xy_[m].fill(NOT_A_NUMBER);
      cov_[m].fill(NOT_A_NUMBER);
      status_[m] = LOST;
    }
  }

  View<double, 2> xy_;
  View<double, 3> cov_;
  const UnrepairedMarkers& markers_;
  const RefinedMarkers& refined_;  // before any was dropped
  const RingTables& tables_;
  const ImageSize& size_;
  const RepairLimits& limits_;
  Index count_;
  Array<double, 1> edge_px_;
  Flags lost_;
  Array<double, 2> known_;  // without the lost markers, and at first without the uncertain ones
  Array<std::uint8_t, 1> status_;
};

}  // namespace

RepairedMarkers repair_markers(const RefinedMarkers& refined, const refine::StartPlaces& places,
                               const RingTables& tables, const ImageSize& size, const RepairLimits& limits) {
  Array<double, 2> xy(refined.xy_px);
  Array<double, 3> cov(refined.cov_px2);
  const MarkerEvidence evidence{refined.explained, places.edge_px, places.agreed, places.is_intact};
  const auto [edge_px, is_complete] =
      update_rejecting_inconsistent(xy, cov, evidence, tables, size, limits.consistency);
  const auto [uncertain, is_any] = find_uncertain_markers(cov, edge_px, limits.uncertain);
  Array<std::uint8_t, 1> status({xy.size()});
  if (is_complete && !is_any) {
    for (Index m = 0; m < xy.size(); ++m) status[m] = std::isfinite(xy(m, 0)) ? MEASURED : LOST;
  } else {
    status = Repair({xy, cov, uncertain, edge_px}, refined, tables, size, limits).run();
  }
  return {std::move(xy), std::move(cov), std::move(status)};
}

}  // namespace cmp::complete
