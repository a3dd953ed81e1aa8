// The ink of every pixel, by hues and levels found in the image.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::image {

// The limits of the labels of pixels; the Python module explains them.
struct LabelLimits {
  double level_share;
  std::int64_t min_chroma;

  template <class F>
  static LabelLimits read(const F& f) {
    return {f["level_share"], f["min_chroma"]};
  }
};

using TileThresholds = std::tuple<Array<std::uint8_t, 3>, Array<double, 1>>;

// The tiles of an image's local levels, of its inks' levels there, and of its target area.
struct LabelTiles {
  View<const std::uint8_t, 3> threshold;  // (3, rows, columns) the minimum chroma of an ink's pixels
  Index tile_px;                          // side of these tiles
  View<const std::uint8_t, 2> target;     // (h, w) 1 in the target area
  Index target_tile_px;                   // side of these tiles

  template <class F>
  static LabelTiles read(const F& f) {
    return {f["threshold"], f["tile_px"], f["target"], f["target_tile_px"]};
  }
};

// Every other pixel of every other row.
Array<std::uint8_t, 2> subsampled(View<const std::uint8_t, 2> plane);

// (3, 2): the first hue of each ink's contiguous range and the number of hues in the range; inks (180,).
Array<std::uint8_t, 2> hue_ranges(View<const std::uint8_t, 1> inks);

// (3, rows, columns) the largest chroma of each ink in every tile; 0 where it is too small.
//
// hue, chroma (H, W); ranges (3, 2) by hue_ranges; tile: side of a tile, px.
Array<float, 3> tile_max_chroma(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                                View<const std::uint8_t, 2> ranges, Index tile, const LabelLimits& limits);

// (3, rows, columns) the minimum chroma of an ink's pixels in each tile; (3,) the upper quartile of the ink's
// levels in all tiles.
//
// A tile's local level is the mean, over the tile and its neighbours, of the largest level around each of
// these.
TileThresholds tile_thresholds(View<const float, 3> level, const LabelLimits& limits);

// (H, W): each pixel's ink where its chroma exceeds the tile's threshold, inside the target area.
Array<std::uint8_t, 2> label_pixels(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                                    View<const std::uint8_t, 2> ranges, const LabelTiles& tiles);

}  // namespace cmp::image
