// The adaptive growing algorithm (AGA, the article's eq. 3).
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "cells/moments.hpp"

namespace cmp::cells {

// The limit of growing.
struct GrowLimits {
  // of eq. 3 over OpenCV's 8-bit HSV, below which a pixel belongs to the region; as in the article.
  // Published: the article, below eq. 3.
  double threshold = 0.15;
};

using GrownRegions = std::tuple<Array<std::int32_t, 2>, Array<double, 2>>;

// Grows every seed in waves of 4-neighbours; a wave is compared with the mean of all waves before it.
//
// hsv (H, W, 3), seed_xy (N, 2); limit_px (N,), the pixels above which a region is dropped. The region map
// (H + 2, W + 2) with a frame of -1 one pixel wide, and the moments (N, 10) about the seeds.
GrownRegions grow(View<const std::uint8_t, 3> hsv, View<const std::int32_t, 2> seed_xy,
                  View<const std::int64_t, 1> limit_px, const GrowLimits& limits);

}  // namespace cmp::cells
