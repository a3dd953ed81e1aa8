// The ink of every pixel, by hues and levels found in the image.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/color.hpp"

namespace cmp::image {

// The limits of the labels of pixels; the Python module explains them.
struct LabelLimits {
  double level_share;
  std::int64_t min_chroma;
  Index tile_px, tiles_across, survey_pixels;
  HueLimits hues;

  template <class F>
  static LabelLimits read(const F& f) {
    return {f["level_share"],  f["min_chroma"],    f["tile_px"],
            f["tiles_across"], f["survey_pixels"], f["hues"]};
  }
};

// The target area.
struct Target {
  View<const std::uint8_t, 2> mask;  // (h, w) 1 for tiles that may belong to the pattern
  Index tile_px;                     // side of a tile, px

  template <class F>
  static Target read(const F& f) {
    return {f["mask"], f["tile_px"]};
  }
};

// found, and label (H, W), hues_deg (3,) and chroma (3,) of Segmentation; empty if an ink is absent.
using SegmentedImage = std::tuple<bool, Array<std::uint8_t, 2>, Array<double, 1>, Array<double, 1>>;

// Labels every pixel of the target area with its ink.
//
// hue, chroma (H, W); nominal_deg (3,), the hues of the palette.
SegmentedImage segment(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                       const Target& target, View<const double, 1> nominal_deg, const LabelLimits& limits);

}  // namespace cmp::image
