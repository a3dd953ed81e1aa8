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

// Their normals, and their weights over the variance of the noise.
struct LaneNormals {
  LaneRow x, y, weight;
};

// The sums over the other gridlines of their normals times the overlap of near end with near end, and of
// their near end with this gridline's far end.
struct LaneInformation {
  LaneRow near_x, near_y, far_x, far_y;
};

// Values at their near and at their far ends.
struct LaneEnds {
  LaneRow near, far;
};

template <class Lanes>
using AtMarkers = std::array<Lanes, MARKER_GRIDLINES>;

// The overlaps of all pairs of gridlines at each marker; sigma, the blur, px.
MarkerOverlaps overlaps_of(const AtMarkers<LaneGridlines>& at, double sigma, const SharedPixelLimits& limits);

// The information that the overlaps add; of two gridlines, the smaller weight counts.
AtMarkers<LaneInformation> information_of(const MarkerOverlaps& overlaps, const AtMarkers<LaneNormals>& at);

// The gradients at the ends of each gridline by the shifts of the others, px.
AtMarkers<LaneEnds> gradients_of(const MarkerOverlaps& overlaps, const AtMarkers<LaneEnds>& shift);

}  // namespace cmp::refine
