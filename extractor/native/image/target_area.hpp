// The target area: the tiles that a flood fill from the image's border does not reach.
#pragma once

#include "base/array.hpp"

namespace cmp::image {

// The limits of the target area; the Python module explains them.
struct TargetLimits {
  double strong_quantile;
  double strong_share;
  std::int64_t min_chroma;

  template <class F>
  static TargetLimits read(const F& f) {
    return {f["strong_quantile"], f["strong_share"], f["min_chroma"]};
  }
};

// (rows, columns) the largest chroma in every tile of tile_px x tile_px pixels; chroma (H, W).
Array<std::uint8_t, 2> tile_chroma(View<const std::uint8_t, 2> chroma, Index tile_px);

// (rows, columns) 1 for tiles that the flood fill does not reach; chroma (rows, columns), at least one tile.
Array<std::uint8_t, 2> target_mask(View<const std::uint8_t, 2> chroma, const TargetLimits& limits);

}  // namespace cmp::image
