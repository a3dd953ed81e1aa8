#include "refine/solve/shared_pixels.hpp"

#include <cmath>
#include <numbers>

#include "refine/solve/fisher_information.hpp"
#include "refine/solve/overlaps.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// The gridlines at one marker, in their order in MarkerGridlines.
struct GridlineNumbers {
  std::array<Index, MARKER_GRIDLINES> at;
  Index count;
};

// Writes gridline e at marker m into a lane.
void fill_gridline(Index m, Index e, const GridlineSystem& system, const SharedPixelLimits& limits,
                   Index lane, LaneGridlines& out) {
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
  out.weight[lane] = system.weight[e];
  out.inverse_length[lane] = 1.0 / lines[LENGTH];
  out.normal_x[lane] = -lines[UY] / system.variance;
  out.normal_y[lane] = lines[UX] / system.variance;
}

// Writes the gridlines at marker m into a lane.
GridlineNumbers fill_gridlines_at_marker(Index m, const GridlineSystem& system,
                                         const SharedPixelLimits& limits, Index lane, MarkerGridlines& out) {
  GridlineNumbers numbers{{}, 0};
  for (Index k = 0; k < system.spokes.size(1); ++k) {
    const Index e = system.spokes(m, k);
    if (e < 0 || system.weight[e] * system.lines(e, KNOWN) == 0.0) continue;
    fill_gridline(m, e, system, limits, lane, out[numbers.count]);
    numbers.at[numbers.count++] = e;
  }
  return numbers;
}

}  // namespace

void add_shared_pixels(const GridlineSystem& system, View<double, 2> diagonal, View<double, 2> off_diagonal,
                       const SharedPixelLimits& limits) {
  const Index count = system.spokes.size();
  MarkerGridlines gridlines;
  std::array<GridlineNumbers, MARKER_LANES> numbers;
  for (Index start = 0; start < count; start += MARKER_LANES) {
    const Index lanes = std::min(MARKER_LANES, count - start);
    gridlines.fill({});
    for (Index lane = 0; lane < lanes; ++lane)
      numbers[lane] = fill_gridlines_at_marker(start + lane, system, limits, lane, gridlines);
    accumulate_overlaps(gridlines, system.sigma, limits);
    for (Index lane = 0; lane < lanes; ++lane) {
      const Index m = start + lane;
      for (Index i = 0; i < numbers[lane].count; ++i) {
        const Index e = numbers[lane].at[i], swap = system.edges(e, 0) == m ? 0 : 1;
        const double nx = -system.lines(e, UY), ny = system.lines(e, UX);
        const LaneGridlines& own = gridlines[i];
        diagonal(m, 0) += own.near_x[lane] * nx;
        diagonal(m, 1) += own.near_x[lane] * ny;
        diagonal(m, 2) += own.near_y[lane] * ny;
        off_diagonal(e, 0) += own.far_x[lane] * nx;
        off_diagonal(e, 1 + swap) += own.far_x[lane] * ny;
        off_diagonal(e, 2 - swap) += own.far_y[lane] * nx;
        off_diagonal(e, 3) += own.far_y[lane] * ny;
      }
    }
  }
}

}  // namespace cmp::refine
