// The pattern as its own grey card: fields that take the light's color from an image.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::image {

// The limits of the grey card; the Python module explains them.
struct GreyCardLimits {
  double sigma_share;
  double half_weight_share;
  double rest_weight_share;
  double white_ratio;
  double ink_ratio;
  double min_level;
  double max_gain;

  template <class F>
  static GreyCardLimits read(const F& f) {
    return {f["sigma_share"], f["half_weight_share"], f["rest_weight_share"], f["white_ratio"],
            f["ink_ratio"],   f["min_level"],         f["max_gain"]};
  }
};

// Gain and offset (3, rows, columns) of each channel at the tiles' middles, and the ratio of the strongest
// channel's mean over black, in the whole pattern, to the weakest one's.
using GreyCardFields = std::tuple<Array<float, 3>, Array<float, 3>, double>;

// (12, rows, columns) of every tile of tile_px x tile_px pixels: the channels' means, their smallest values,
// the means of their squares, and of the products of channels 0 and 1, 1 and 2, 2 and 0. Of the pixels, every
// `step`-th one of every `step`-th row counts; image (H, W, 3).
Array<float, 3> tile_statistics(View<const std::uint8_t, 3> image, Index tile_px, Index step);

// The fields by the statistics (12, rows, columns) of tiles; gain 1 and offset 0 in white light.
GreyCardFields grey_card_fields(View<const float, 3> statistics, const GreyCardLimits& limits);

// (H, W, 3) value * gain + offset, rounded and clipped; the fields (3, rows, columns) of tiles of tile_px
// pixels are interpolated linearly between the tiles' middles.
Array<std::uint8_t, 3> with_fields(View<const std::uint8_t, 3> image, View<const float, 3> gain,
                                   View<const float, 3> offset, double tile_px);

}  // namespace cmp::image
