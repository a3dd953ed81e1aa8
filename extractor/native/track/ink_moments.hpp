// The area and the first moments of an ink in a window of pixels.
#pragma once

#include "base/array.hpp"

namespace cmp::track {

inline constexpr Index BLOCK_PIXELS = 512;  // pixels whose moments are summed together

// The ink of a pixel: the weighted sum of its channels minus `zero`, at most 1; 0 unless more than `least`.
struct InkWeights {
  std::array<double, 3> weights;
  double zero, least;
};

// Area and moments in x and y.
struct InkMoments {
  double area = 0.0, x = 0.0, y = 0.0;
};

// Pixels of several rows: a row alone is too short for loops that take many pixels at once.
struct PixelBlock {
  std::array<std::uint32_t, BLOCK_PIXELS> color;  // the lowest bytes are blue, green and red
  std::array<std::int32_t, BLOCK_PIXELS> x, y;
  Index count = 0;
};

// Adds pixels of the row y, from x on, until the row or the block ends; returns the x after the last one.
//
// flat (3 H W,); width of the image; end: the x after the row's last pixel.
Index append_pixels(View<const std::uint8_t, 1> flat, Index width, Index y, Index x, Index end,
                    PixelBlock& block);

// Adds the ink of the pixels of a block; moments about (x, y).
void add_ink_moments(const PixelBlock& block, double x, double y, const InkWeights& ink, InkMoments& sums);

}  // namespace cmp::track
