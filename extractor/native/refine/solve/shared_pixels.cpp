#include "refine/solve/shared_pixels.hpp"

#include <cmath>
#include <numbers>

#include "refine/solve/fisher_information.hpp"
#include "refine/solve/overlaps.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// Whether gridline e, -1 for none, is drawn and counts.
bool is_drawn(const GridlineSystem& system, Index e) {
  return e >= 0 && system.weight[e] * system.lines(e, KNOWN) != 0.0;
}

// Writes gridline e at marker m into a lane.
void fill_gridline(Index m, Index e, const GridlineSystem& system, const SharedPixelLimits& limits,
                   std::size_t lane, LaneGridlines& out) {
  const auto lines = system.lines[e], sums = system.sums[e], contrast = system.contrasts[e];
  // the direction in which the curved gridline leaves the marker
  const double sense = system.edges(e, 0) == m ? 1.0 : -1.0;
  const double slope = sense > 0.0 ? lines[LEAVE] : lines[ARRIVE];
  const double size = sense / std::sqrt(1.0 + slope * slope);
  out.x[lane] = size * (lines[UX] - slope * lines[UY]);
  out.y[lane] = size * (lines[UY] + slope * lines[UX]);
  // the smaller the measured part of a gridline that the image's border cuts, the less it shares
  const double c0 = contrast[0], c1 = contrast[1], c2 = contrast[2];
  const double uncut =
      (c0 * c0 + c1 * c1 + c2 * c2) * lines[LENGTH] / (6.0 * std::sqrt(std::numbers::pi) * system.sigma);
  const double end_sum = sense > 0.0 ? sums[AA] : sums[BB];
  const double part =
      std::min(end_sum / std::max(limits.min_end_information * uncut, limits.min_uncut_information), 1.0);
  out.red[lane] = part * c0;
  out.green[lane] = part * c1;
  out.blue[lane] = part * c2;
  out.inverse_length[lane] = 1.0 / lines[LENGTH];
}

// A gridline at a marker.
struct GridlineAtMarker {
  Index e, other;  // the gridline, and the marker at its far end
  bool starts;     // at the marker
  double nx, ny;   // its normal

  GridlineAtMarker(const GridlineSystem& system, Index m, Index gridline)
      : e(gridline),
        other(system.edges(e, system.edges(e, 0) == m ? 1 : 0)),
        starts(system.edges(e, 0) == m),
        nx(-system.lines(e, UY)),
        ny(system.lines(e, UX)) {}

  // The shift of a marker along the normal, of shifts (M, 2).
  double along(View<const double, 2> shift, Index m) const { return nx * shift(m, 0) + ny * shift(m, 1); }
  // The gradient at the marker, or at the far end.
  double& gradient(ShiftGradients& of, bool near) const { return near == starts ? of.start[e] : of.end[e]; }

  // Adds the product of the other gridline's near end and this one's far end.
  void add_far(double value, const GridlineAtMarker& second, View<double, 2> off_diagonal) const {
    const auto block = off_diagonal[e];
    block[0] += value * second.nx * nx;
    block[starts ? 1 : 2] += value * second.nx * ny;
    block[starts ? 2 : 1] += value * second.ny * nx;
    block[3] += value * second.ny * ny;
  }
};

// Calls act(marker, first, second, pair, lane) for all pairs of known gridlines at each marker.
template <class Act>
void for_pairs(const GridlineSystem& system, const Act& act) {
  const auto spokes = system.spokes;
  for (Index m = 0; m < spokes.size(); ++m) {
    std::size_t pair = 0;
    for (Index i = 0; i < spokes.size(1); ++i) {
      for (Index j = i + 1; j < spokes.size(1); ++j, ++pair) {
        const Index e = spokes(m, i), f = spokes(m, j);
        if (is_drawn(system, e) && is_drawn(system, f))
          act(m, GridlineAtMarker(system, m, e), GridlineAtMarker(system, m, f), pair);
      }
    }
  }
}

}  // namespace

SharedPixels::SharedPixels(const GridlineSystem& system, const SharedPixelLimits& limits) {
  const auto count = static_cast<std::size_t>(system.spokes.size());
  overlaps_.reserve(count / MARKER_LANES + 1);
  MarkerGridlines gridlines;
  for (std::size_t start = 0; start < count; start += MARKER_LANES) {
    gridlines.fill({});
    for (std::size_t lane = 0; lane < std::min(MARKER_LANES, count - start); ++lane) {
      const auto m = static_cast<Index>(start + lane);
      for (Index k = 0; k < system.spokes.size(1); ++k) {
        const Index e = system.spokes(m, k);
        if (is_drawn(system, e)) fill_gridline(m, e, system, limits, lane, gridlines[static_cast<std::size_t>(k)]);
      }
    }
    overlaps_.push_back(overlaps_of(gridlines, system.sigma, limits));
  }
}

void SharedPixels::add_information(const GridlineSystem& system, View<double, 2> diagonal,
                                   View<double, 2> off_diagonal) const {
  for_pairs(system, [&](Index m, const GridlineAtMarker& first, const GridlineAtMarker& second, std::size_t pair) {
    const auto lane = static_cast<std::size_t>(m) % MARKER_LANES;
    const LaneOverlaps& shared = overlaps_[static_cast<std::size_t>(m) / MARKER_LANES][pair];
    const double weight = std::min(system.weight[first.e], system.weight[second.e]) / system.variance;
    const double near = weight * shared.near[lane];
    diagonal(m, 0) += 2.0 * near * first.nx * second.nx;
    diagonal(m, 1) += near * (first.nx * second.ny + first.ny * second.nx);
    diagonal(m, 2) += 2.0 * near * first.ny * second.ny;
    first.add_far(weight * shared.far_first[lane], second, off_diagonal);
    second.add_far(weight * shared.far_second[lane], first, off_diagonal);
  });
}

void SharedPixels::explain(const GridlineSystem& system, View<const double, 2> shift,
                           ShiftGradients& left) const {
  for_pairs(system, [&](Index m, const GridlineAtMarker& first, const GridlineAtMarker& second, std::size_t pair) {
    const auto lane = static_cast<std::size_t>(m) % MARKER_LANES;
    const LaneOverlaps& shared = overlaps_[static_cast<std::size_t>(m) / MARKER_LANES][pair];
    const double near = shared.near[lane], far_first = shared.far_first[lane], far_second = shared.far_second[lane];
    const double of_first = first.along(shift, m), of_second = second.along(shift, m);
    first.gradient(left, true) -= near * of_second + far_second * second.along(shift, second.other);
    first.gradient(left, false) -= far_first * of_second;
    second.gradient(left, true) -= near * of_first + far_first * first.along(shift, first.other);
    second.gradient(left, false) -= far_second * of_first;
  });
}

}  // namespace cmp::refine
