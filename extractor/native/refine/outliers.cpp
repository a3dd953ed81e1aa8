#include "refine/outliers.hpp"

#include <cmath>
#include <limits>

#include "layout/neighbour_tables.hpp"
#include "numeric/median.hpp"
#include "refine/measure/gridline_bending.hpp"

namespace cmp::refine {

namespace {

using layout::Topology;

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
// Share of a third difference that is the error of one of its two inner markers; all of it is, of an outer
// one.
constexpr double INNER_MARKER_SHARE = 1.0 / 3.0, OUTER_MARKER_SHARE = 1.0;

// The shifts that the gridlines through each marker agree on.
struct AgreedShifts {
  Array<bool, 1> known;     // (M,) the marker was asked for
  Array<double, 2> shift;   // (M, 2) px, the median of the shifts by the single gridlines
  Array<double, 1> length;  // (M,) px, NaN where too few gridlines are known
  Array<bool, 1> agreeing;  // (M,) enough gridlines agree

  explicit AgreedShifts(Index count)
      : known({count}, false),
        shift({count, 2}, 0.0),
        length({count}, NOT_A_NUMBER),
        agreeing({count}, false) {}
};

bool any(View<const bool, 1> values) {
  return std::any_of(values.begin(), values.end(), [](bool value) { return value; });
}

// (M,), the selected markers' (M,) two rings `near` (M, 18), and those selected markers that lack a
// neighbour.
Array<bool, 1> within_two_rings(View<const bool, 1> selected, View<const std::int32_t, 2> near) {
  Array<bool, 1> out({selected.size()}, false);
  for (Index m = 0; m < selected.size(); ++m) {
    if (!selected[m]) continue;
    for (Index k = 0; k < near.size(1); ++k) out[near(m, k) >= 0 ? near(m, k) : m] = true;
  }
  return out;
}

// Fills in (E, 2) px along the gridlines with a `changed` end (M,), NaN where one of the four markers along a
// gridline is not known.
void fill_third_differences(View<const double, 2> xy, View<const bool, 1> changed, View<const double, 3> maps,
                            const Topology& topology, View<double, 2> out) {
  const auto edges = topology.edges, ahead = topology.next_markers;
  for (Index e = 0; e < edges.size(); ++e) {
    if (!changed[edges(e, 0)] && !changed[edges(e, 1)]) continue;
    ThirdDifference difference{NOT_A_NUMBER, NOT_A_NUMBER};
    if (ahead(e, 0) >= 0 && ahead(e, 1) >= 0)
      difference = third_difference(xy, maps, edges, ahead, topology.third_differences, e);
    out(e, 0) = difference.x;
    out(e, 1) = difference.y;
  }
}

// A gridline that shows the error of a marker, and the share of its third difference that is this error.
struct ErrorShare {
  std::int32_t edge;  // -1 without one
  double share;
};

// The gridline along spoke k of marker m, or the next one: where no gridline goes on behind the marker, the
// marker is the last of the next four.
ErrorShare error_share(const Topology& topology, View<const double, 2> differences, Index m, Index k) {
  std::int32_t e = topology.spokes(m, k);
  if (e >= 0 && std::isfinite(differences(e, 0))) return {e, INNER_MARKER_SHARE};
  e = topology.next_edges(m, k);
  if (e >= 0 && std::isfinite(differences(e, 0))) return {e, OUTER_MARKER_SHARE};
  return {-1, 0.0};
}

// Of the `changed` markers: sets `known` to false, and `moving` to whether gridlines could agree on a shift
// of more than `least` px, by the largest third differences (E, 2) in x and in y.
void update_candidates(View<const bool, 1> changed, View<const double, 1> least,
                       View<const double, 2> differences, const Topology& topology, View<bool, 1> moving,
                       View<bool, 1> known, const OutlierLimits& limits) {
  for (Index m = 0; m < changed.size(); ++m) {
    if (!changed[m]) continue;
    double x = 0.0, y = 0.0;
    Index count = 0;
    for (Index k = 0; k < topology.spokes.size(1); ++k) {
      const auto [e, share] = error_share(topology, differences, m, k);
      if (e < 0) continue;
      x = std::max(x, share * std::abs(differences(e, 0)));
      y = std::max(y, share * std::abs(differences(e, 1)));
      ++count;
    }
    known[m] = false;
    moving[m] = count >= limits.min_agreeing_gridlines &&
                x * x + y * y > limits.rounding_allowance * (least[m] * least[m]);
  }
}

// Makes the agreed shift of marker m from the third differences (E, 2).
void update_agreed_shift(Index m, View<const double, 2> differences, const Topology& topology,
                         AgreedShifts& shifts, const OutlierLimits& limits) {
  std::array<std::array<double, layout::SPOKES>, 2> single;
  Index count = 0;
  for (Index k = 0; k < topology.spokes.size(1); ++k) {
    const auto [e, share] = error_share(topology, differences, m, k);
    if (e < 0) continue;
    const bool is_positive = topology.edges(e, 1) == m || topology.next_markers(e, 0) == m;
    const double part = is_positive ? share : -share;
    single[0][count] = part * differences(e, 0);
    single[1][count] = part * differences(e, 1);
    ++count;
  }
  if (count < limits.min_agreeing_gridlines) return;
  const double x = numeric::median_of({single[0].data(), {count}}, count);
  const double y = numeric::median_of({single[1].data(), {count}}, count);
  const double square = x * x + y * y;
  shifts.shift(m, 0) = x;
  shifts.shift(m, 1) = y;
  shifts.length[m] = std::sqrt(square);
  Index agreeing = 0;
  for (Index k = 0; k < count; ++k) {
    const double dx = single[0][k] - x, dy = single[1][k] - y;
    agreeing += dx * dx + dy * dy < limits.agreement_tolerance * limits.agreement_tolerance * square;
  }
  shifts.agreeing[m] = agreeing >= limits.min_agreeing_gridlines &&
                       static_cast<double>(agreeing) > limits.min_agreeing_share * static_cast<double>(count);
}

// Makes the shifts of the selected markers (M,) that are not known yet.
void update_agreed_shifts(View<const bool, 1> selected, View<const double, 2> differences,
                          const Topology& topology, AgreedShifts& shifts, const OutlierLimits& limits) {
  for (Index m = 0; m < selected.size(); ++m) {
    if (shifts.known[m] || !selected[m]) continue;
    shifts.known[m] = true;
    update_agreed_shift(m, differences, topology, shifts, limits);
  }
}

// px, the median length of the known shifts of the markers `near` (18,); infinite without any.
double median_shift(View<const double, 1> length, View<const std::int32_t, 1> near) {
  std::array<double, layout::RING_MARKERS> column;
  Index count = 0;
  for (const std::int32_t n : near) {
    if (n >= 0 && std::isfinite(length[n])) column[count++] = length[n];
  }
  return count > 0 ? numeric::median_of({column.data(), {count}}, count)
                   : std::numeric_limits<double>::infinity();
}

// Moves the markers whose shift is the largest around and exceeds those around by the ratio; these are
// outliers, and `changed`.
void update_outliers(View<const bool, 1> moving, View<const bool, 1> suspect, const AgreedShifts& shifts,
                     View<const std::int32_t, 2> near, View<double, 2> xy, View<bool, 1> outliers,
                     View<bool, 1> changed, const OutlierLimits& limits) {
  changed.fill(false);
  for (Index m = 0; m < moving.size(); ++m) {
    if (!moving[m]) continue;
    const double length = shifts.length[m];
    bool is_largest = true;
    for (Index k = 0; k < FIRST_RING; ++k) {
      const std::int32_t n = near(m, k);
      is_largest = is_largest && !(n >= 0 && shifts.length[n] > length);
    }
    const double ratio = limits.outlier_ratios[suspect[m] ? 0 : 1];
    if (is_largest && length > ratio * median_shift(shifts.length.view(), near[m])) {
      xy(m, 0) -= shifts.shift(m, 0);
      xy(m, 1) -= shifts.shift(m, 1);
      outliers[m] = changed[m] = true;
    }
  }
}

// (M,), the outliers.
//
// xy (M, 2) px, NaN where unknown; maps (M, 2, 5), as local_maps gives them; suspect (M,); edge (M,) px, the
// length of the edges at each marker.
Array<bool, 1> outlier_markers(View<const double, 2> xy, View<const double, 3> maps,
                               View<const bool, 1> suspect, View<const double, 1> edge,
                               const Topology& topology, const OutlierLimits& limits) {
  const Index count = xy.size();
  const auto near = topology.ring_markers;
  Array<double, 2> out(xy);
  Array<bool, 1> outliers({count}, false), changed({count}, true);
  AgreedShifts shifts(count);
  Array<double, 1> least({count});
  for (Index m = 0; m < count; ++m) least[m] = limits.min_outlier_shifts[suspect[m] ? 0 : 1] * edge[m];
  // few markers could have to move at all; shifts are made only for these and those around them
  Array<bool, 1> moving({count}, false);
  Array<double, 2> differences({topology.edges.size(), 2});
  for (Index round = 0; round < limits.max_rounds; ++round) {
    fill_third_differences(out, changed, maps, topology, differences);
    update_candidates(changed, least, differences, topology, moving, shifts.known, limits);
    update_agreed_shifts(moving, differences, topology, shifts, limits);
    for (Index m = 0; m < count; ++m)
      moving[m] = moving[m] && shifts.agreeing[m] && shifts.length[m] > least[m];
    update_agreed_shifts(within_two_rings(moving, near), differences, topology, shifts, limits);
    update_outliers(moving, suspect, shifts, near, out, outliers, changed, limits);
    if (!any(changed)) break;
    const Array<bool, 1> around = within_two_rings(changed, near);
    for (Index m = 0; m < count; ++m) changed[m] = changed[m] || around[m];
  }
  return outliers;
}

}  // namespace

CorrectedOutliers correct_outliers(const Topology& topology, const MeasuredMarkers& markers,
                                   const StartPlaces& places, View<const double, 1> profile_weight,
                                   double scale, const OutlierLimits& limits) {
  const Array<bool, 1> suspect =
      suspect_markers<double>(profile_weight, markers.weight, topology.spokes, limits);
  if (!any(suspect)) return {};
  const Index count = suspect.size();
  Array<double, 2> known(markers.reliable), measured(markers.measured), reliable(markers.reliable);
  Array<double, 2> start(places.xy_px);
  Array<bool, 1> agreed(places.agreed), is_intact(places.is_intact);
  Array<double, 1> edge({count});
  for (Index m = 0; m < count; ++m) {
    if (markers.hidden[m]) known[m].fill(NOT_A_NUMBER);
    edge[m] = places.edge_px[m] / scale;
  }
  Array<bool, 1> outliers = outlier_markers(known, markers.maps, suspect, edge, topology, limits);
  for (Index m = 0; m < count; ++m) outliers[m] = outliers[m] || (suspect[m] && !agreed[m]);
  const bool found = any(outliers);
  if (found) {
    for (Index m = 0; m < count; ++m) {
      if (outliers[m]) known[m].fill(NOT_A_NUMBER);
    }
    const Array<double, 2> xy =
        extrapolate_rings(known, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil,
                          limits.extrapolated_rings, limits.gridlines);
    for (Index m = 0; m < count; ++m) {
      if (!outliers[m] || !std::isfinite(xy(m, 0))) continue;
      for (Index axis = 0; axis < 2; ++axis) measured(m, axis) = reliable(m, axis) = xy(m, axis);
      const double x = (xy(m, 0) + 0.5) * scale - 0.5, y = (xy(m, 1) + 0.5) * scale - 0.5;
      const double dx = x - start(m, 0), dy = y - start(m, 1);
      const double distance = std::sqrt(dx * dx + dy * dy);
      agreed[m] = agreed[m] && !(distance > limits.max_place_error * places.edge_px[m]);
      is_intact[m] = false;
      start(m, 0) = x;
      start(m, 1) = y;
    }
  }
  return {found,
          std::move(measured),
          std::move(reliable),
          std::move(start),
          std::move(agreed),
          std::move(is_intact)};
}

}  // namespace cmp::refine
