// Sums of the pixels around the stations of a gridline, where its virtual markers are.
#pragma once

#include "base/array.hpp"
#include "refine/synthesis/pixel_weights.hpp"

namespace cmp::refine {

// columns of the sums at a station
inline constexpr Index STATION_RESIDUAL = 0, STATION_INFORMATION = 1, STATION_SUMS = 2;

// Adds the pixels of a block to the sums (m, 2) at the m stations of its gridline: the weighted residual, and
// the information. A pixel belongs to the nearest station; its weight is the derivative of the drawing by an
// offset of the whole gridline.
//
// pixels: after accumulate_sums; their projection and information become those of their stations.
void accumulate_station_sums(const RowBlock& block, const PixelGeometry& line, GridlinePixels& pixels,
                             View<double, 2> sums);

}  // namespace cmp::refine
