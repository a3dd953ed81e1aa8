// Hue and chroma of an image, and the hues of its inks under the light of the image.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::image {

inline constexpr int HUES = 180;             // OpenCV's 8-bit hue counts in steps of 2 degrees
inline constexpr double HUE_STEP_DEG = 2.0;  // degrees per step of hue
inline constexpr int INKS = 3;               // red, green, blue

// The limits of the search for the inks' hues; the Python module explains them.
struct HueLimits {
  double reach_deg;
  double width_deg;
  std::int64_t rounds;
  std::int64_t min_chroma;
  double ink_width_deg;

  template <class F>
  static HueLimits read(const F& f) {
    return {f["reach_deg"], f["width_deg"], f["rounds"], f["min_chroma"], f["ink_width_deg"]};
  }
};

using HueImages = std::tuple<Array<std::uint8_t, 3>, Array<std::uint8_t, 2>, Array<std::uint8_t, 2>>;
using FoundHues = std::tuple<Array<double, 1>, bool>;

// HSV (H, W, 3), equal to OpenCV's in every bit; hue (H, W); chroma (H, W), S V / 255, which is max - min of
// B, G, R.
//
// image (H, W, 3) BGR without gaps.
HueImages hsv_and_chroma(View<const std::uint8_t, 3> image);

// (180,) the sum of the chroma of all colored pixels of each hue; hue, chroma (H, W).
Array<double, 1> hue_weights(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                             const HueLimits& limits);

// Circular 3-means of a hue histogram (180,), limited to a reach around the nominal hues (3,), degrees.
//
// (3,) hues in degrees, and whether every ink has pixels.
FoundHues find_hues(View<const double, 1> weight, View<const double, 1> nominal_deg, const HueLimits& limits);

// (180,): the ink (1, 2, 3) with the nearest of the hues (3,), 0 where all are too far away.
Array<std::uint8_t, 1> ink_of_hue(View<const double, 1> hues_deg, const HueLimits& limits);

}  // namespace cmp::image
