// Hue, saturation and value of an image.
#pragma once

#include "base/array.hpp"

namespace cmp::image {

inline constexpr int HUES = 180;  // OpenCV's 8-bit hue counts in steps of 2 degrees

// HSV (H, W, 3) of an image (H, W, 3) BGR, equal to OpenCV's in every bit.
Array<std::uint8_t, 3> to_hsv(View<const std::uint8_t, 3> image);

}  // namespace cmp::image
