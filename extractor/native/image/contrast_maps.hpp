// Maps in which the cells of some inks are brighter than the black around them, and the local levels of both.
#pragma once

#include "base/array.hpp"

namespace cmp::image {

// Each channel; the sum of the channels; each channel over the mean of the others; each channel over
// the least one.
inline constexpr Index CONTRAST_MAPS = 10;

// A map with its local levels at the middles of tiles.
struct ContrastMap {
  Array<std::uint8_t, 2> value;  // (H, W)
  Array<float, 2> low, high;     // (tile rows, tile columns) the levels of black and of the brightest cells
  Index tile_px;
};

// The channels (3, H, W) of an image (H, W, 3), smoothed by 1 2 1 in both directions.
Array<std::uint8_t, 3> smoothed_channels(View<const std::uint8_t, 3> image);

// Map `number` of the smoothed channels. The levels are the least and the largest values around each tile.
ContrastMap contrast_map(View<const std::uint8_t, 3> channels, Index number, Index tile_px);

// The standard deviation of the noise of the noisiest of an image's channels (3, H, W), gray levels of 255.
//
// A quantile of the diagonal second differences: edges are fewer than plain pixels.
double channel_noise(View<const std::uint8_t, 3> channels);

}  // namespace cmp::image
