// The pixels around the stations of a gridline, where its virtual markers are.
#pragma once

#include "base/array.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

struct alignas(64) StationPixels {
  PixelColumn station;       // the number of the station that a pixel belongs to
  PixelColumn weight;        // the normal density, 0 beyond the band
  PixelColumn before_share;  // the share of the light before the gridline
};

struct StationSums {
  float residual, information;
};

// Fills in the pixels of the rows of a block.
//
// intervals, between the stations of a gridline and its ends; band, in units of the blur, the distance from a
// gridline within which pixels count.
void fill_stations(const BlockRows& rows, const RowBlock& block, const PixelGeometry& line, float intervals,
                   float band, StationPixels& pixels);

// The sums of the weighted residuals and of the information of the first `count` pixels at a station.
StationSums sums_at_station(const StationPixels& pixels, const Residuals& residuals, Index count,
                            float station);

}  // namespace cmp::refine
