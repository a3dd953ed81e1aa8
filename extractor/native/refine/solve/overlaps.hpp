// The overlaps of the gridlines that meet at a marker, for many markers at once.
#pragma once

#include <array>

#include "base/array.hpp"
#include "refine/solve/shared_pixels.hpp"

namespace cmp::refine {

inline constexpr Index MARKER_LANES = 8;      // markers side by side
inline constexpr Index MARKER_GRIDLINES = 6;  // at a marker at most

// Gridlines that end at `MARKER_LANES` markers, one at each, with their sums; zero where a marker has fewer
// gridlines.
struct LaneGridlines {
  using Row = std::array<double, MARKER_LANES>;
  Row x, y;                // direction away from the marker
  Row red, green, blue;    // contrast, gray levels
  Row weight;              // 0 to 1
  Row inverse_length;      // 1/px
  Row normal_x, normal_y;  // over the variance of the noise
  // sums over the other gridlines of their normals times the overlap of near end with near end, and of their
  // near end with this one's far end
  Row near_x, near_y, far_x, far_y;
};

using MarkerGridlines = std::array<LaneGridlines, MARKER_GRIDLINES>;

// Adds the overlaps of all gridlines at each marker to their sums; sigma, the blur, px.
void accumulate_overlaps(MarkerGridlines& at, double sigma, const SharedPixelLimits& limits);

}  // namespace cmp::refine
