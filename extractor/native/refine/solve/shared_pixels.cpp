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

// Calls act(m, e, spoke, lane) for all gridlines that are drawn at the markers of a block of lanes.
template <class Act>
void for_gridlines(const GridlineSystem& system, std::size_t block, const Act& act) {
  const auto spokes = system.spokes;
  const auto count = static_cast<std::size_t>(spokes.size());
  for (std::size_t lane = 0; lane < MARKER_LANES && block * MARKER_LANES + lane < count; ++lane) {
    const auto m = static_cast<Index>(block * MARKER_LANES + lane);
    for (Index k = 0; k < spokes.size(1); ++k) {
      if (is_drawn(system, spokes(m, k))) act(m, spokes(m, k), static_cast<std::size_t>(k), lane);
    }
  }
}

}  // namespace

SharedPixels::SharedPixels(const GridlineSystem& system, const SharedPixelLimits& limits) {
  const std::size_t blocks =
      (static_cast<std::size_t>(system.spokes.size()) + MARKER_LANES - 1) / MARKER_LANES;
  overlaps_.reserve(blocks);
  AtMarkers<LaneGridlines> at;
  for (std::size_t block = 0; block < blocks; ++block) {
    at.fill({});
    for_gridlines(system, block, [&](Index m, Index e, std::size_t k, std::size_t lane) {
      fill_gridline(m, e, system, limits, lane, at[k]);
    });
    overlaps_.push_back(overlaps_of(at, system.sigma, limits));
  }
}

void SharedPixels::add_information(const GridlineSystem& system, View<double, 2> diagonal,
                                   View<double, 2> off_diagonal) const {
  AtMarkers<LaneNormals> at;
  for (std::size_t block = 0; block < overlaps_.size(); ++block) {
    at.fill({});
    for_gridlines(system, block, [&](Index, Index e, std::size_t k, std::size_t lane) {
      at[k].x[lane] = -system.lines(e, UY);
      at[k].y[lane] = system.lines(e, UX);
      at[k].weight[lane] = system.weight[e] / system.variance;
    });
    const AtMarkers<LaneInformation> added = information_of(overlaps_[block], at);
    for_gridlines(system, block, [&](Index m, Index e, std::size_t k, std::size_t lane) {
      const LaneInformation& own = added[k];
      const double nx = at[k].x[lane], ny = at[k].y[lane];
      const Index swap = system.edges(e, 0) == m ? 0 : 1;
      diagonal(m, 0) += own.near_x[lane] * nx;
      diagonal(m, 1) += own.near_x[lane] * ny;
      diagonal(m, 2) += own.near_y[lane] * ny;
      off_diagonal(e, 0) += own.far_x[lane] * nx;
      off_diagonal(e, 1 + swap) += own.far_x[lane] * ny;
      off_diagonal(e, 2 - swap) += own.far_y[lane] * nx;
      off_diagonal(e, 3) += own.far_y[lane] * ny;
    });
  }
}

void SharedPixels::update_explained(const GridlineSystem& system, View<const double, 2> shift,
                                    ShiftGradients& left) const {
  AtMarkers<LaneEnds> at;
  for (std::size_t block = 0; block < overlaps_.size(); ++block) {
    at.fill({});
    for_gridlines(system, block, [&](Index m, Index e, std::size_t k, std::size_t lane) {
      const double nx = -system.lines(e, UY), ny = system.lines(e, UX);
      const Index far = system.edges(e, system.edges(e, 0) == m ? 1 : 0);
      at[k].near[lane] = nx * shift(m, 0) + ny * shift(m, 1);
      at[k].far[lane] = nx * shift(far, 0) + ny * shift(far, 1);
    });
    const AtMarkers<LaneEnds> explained = gradients_of(overlaps_[block], at);
    for_gridlines(system, block, [&](Index m, Index e, std::size_t k, std::size_t lane) {
      const bool starts = system.edges(e, 0) == m;
      left.start[e] -= starts ? explained[k].near[lane] : explained[k].far[lane];
      left.end[e] -= starts ? explained[k].far[lane] : explained[k].near[lane];
    });
  }
}

}  // namespace cmp::refine
