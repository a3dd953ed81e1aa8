// The overlaps of the gridlines that meet at a marker, for many markers at once.
#pragma once

#include <array>

#include "base/array.hpp"
#include "refine/solve/shared_pixels.hpp"

namespace cmp::refine {

// Gridlines that end at `MARKER_LANES` markers, one at each; zero where a marker has fewer gridlines.
struct LaneGridlines {
  LaneRow x, y;              // direction away from the marker
  LaneRow red, green, blue;  // contrast, gray levels
  LaneRow inverse_length;    // 1/px
};

using MarkerGridlines = std::array<LaneGridlines, MARKER_GRIDLINES>;

// The overlaps of all pairs of gridlines at each marker; sigma, the blur, px.
MarkerOverlaps overlaps_of(const MarkerGridlines& at, double sigma, const SharedPixelLimits& limits);

}  // namespace cmp::refine
