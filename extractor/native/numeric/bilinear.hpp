// Bilinear samples of an image at sub-pixel points.
//
// The image (H, W, 3) is passed as `flat` (3 H W,) with its height and width. Sub-pixel parts are rounded to
// 1 / SUBPIXEL_STEPS px.
#pragma once

#include <limits>

#include "base/array.hpp"

namespace cmp::numeric {

inline constexpr int SUBPIXEL_STEPS = 256;  // per pixel
inline constexpr double BORDER_PX =
    1.0 + 1e-6;  // distance of the last sample from the image's width or height
inline constexpr int HEXAGON_COUNT = 7;
// The centre and the corners of a hexagon of radius 1.
inline constexpr double HEXAGON_POINTS[HEXAGON_COUNT][2] = {{0.0, 0.0},
                                                            {1.0, 0.0},
                                                            {0.5, 0.8660254037844386},
                                                            {-0.5, 0.8660254037844386},
                                                            {-1.0, 0.0},
                                                            {-0.5, -0.8660254037844386},
                                                            {0.5, -0.8660254037844386}};

// The channels' sums of four pixels, times the square of SUBPIXEL_STEPS.
struct ChannelSums {
  std::int64_t s0, s1, s2;
};

// The sums at a place inside the image, not beyond its width or height minus BORDER_PX.
inline ChannelSums channel_sums_at(View<const std::uint8_t, 1> flat, Index width, double x, double y) {
  const auto ix = static_cast<std::int64_t>(x), iy = static_cast<std::int64_t>(y);
  const auto fx = static_cast<std::int64_t>((x - static_cast<double>(ix)) * SUBPIXEL_STEPS + 0.5);
  const auto fy = static_cast<std::int64_t>((y - static_cast<double>(iy)) * SUBPIXEL_STEPS + 0.5);
  const Index a = (iy * width + ix) * 3, b = a + width * 3;
  const std::int64_t both = fx * fy;  // integers are faster
  const std::int64_t right = SUBPIXEL_STEPS * fx - both, down = SUBPIXEL_STEPS * fy - both;
  const std::int64_t rest = SUBPIXEL_STEPS * (SUBPIXEL_STEPS - fx - fy) + both;
  return {rest * flat[a] + right * flat[a + 3] + down * flat[b] + both * flat[b + 3],
          rest * flat[a + 1] + right * flat[a + 4] + down * flat[b + 1] + both * flat[b + 4],
          rest * flat[a + 2] + right * flat[a + 5] + down * flat[b + 2] + both * flat[b + 5]};
}

// The sample at (x, y), the channels 0, 1, 2 multiplied by the weights red, green, blue; NaN outside the
// image.
inline double weighted_sample(View<const std::uint8_t, 1> flat, Index height, Index width, double x, double y,
                              double red, double green, double blue) {
  const auto w = static_cast<double>(width), h = static_cast<double>(height);
  if (!(x >= 0.0 && y >= 0.0 && x <= w - 1.0 && y <= h - 1.0))
    return std::numeric_limits<double>::quiet_NaN();
  const auto sums = channel_sums_at(flat, width, std::min(x, w - BORDER_PX), std::min(y, h - BORDER_PX));
  return (red * static_cast<double>(sums.s0) + green * static_cast<double>(sums.s1) +
          blue * static_cast<double>(sums.s2)) *
         (1.0 / (SUBPIXEL_STEPS * SUBPIXEL_STEPS));
}

// Writes the mean (3,) of seven samples, at (x, y) and on a hexagon of `radius` px; false outside the image.
inline bool fill_patch_mean(View<const std::uint8_t, 1> flat, Index height, Index width, double x, double y,
                            double radius, View<double, 1> out) {
  const auto w = static_cast<double>(width), h = static_cast<double>(height);
  if (!(x >= radius && y >= radius && x <= w - 1.0 - radius && y <= h - 1.0 - radius)) return false;
  ChannelSums total{0, 0, 0};
  for (const auto& point : HEXAGON_POINTS) {
    const auto sums = channel_sums_at(flat, width, std::min(x + radius * point[0], w - BORDER_PX),
                                      std::min(y + radius * point[1], h - BORDER_PX));
    total.s0 += sums.s0;
    total.s1 += sums.s1;
    total.s2 += sums.s2;
  }
  const double share = 1.0 / (HEXAGON_COUNT * SUBPIXEL_STEPS * SUBPIXEL_STEPS);
  out[0] = static_cast<double>(total.s0) * share;
  out[1] = static_cast<double>(total.s1) * share;
  out[2] = static_cast<double>(total.s2) * share;
  return true;
}

}  // namespace cmp::numeric
