#include "image/color.hpp"

#include <algorithm>

namespace cmp::image {

namespace {

constexpr int FRACTION_BITS = 12;  // of the quotients below, as in OpenCV
constexpr int HALF = 1 << (FRACTION_BITS - 1);
constexpr auto FULL_SATURATION = static_cast<float>(255 << FRACTION_BITS);
constexpr auto SIXTH_OF_HUES = static_cast<float>(HUES * (1 << FRACTION_BITS) / 6);
constexpr Index STRIP_PX = 256;  // few enough that the strip stays in the nearest cache

// Adjacent pixels, an array for each quantity: each loop over them has numbers as narrow as it can have, so
// that as many as possible fit into one instruction.
struct Strip {
  template <class T>
  using Plane = std::array<T, STRIP_PX>;
  Plane<std::uint8_t> blue, green, red, value, spread, saturation, hue;
  Plane<std::int16_t> sixth;  // hue in sixths of the circle, times the spread
  Plane<std::int16_t> wide_saturation, turn;

  void read(View<const std::uint8_t, 1> bgr) {
    const Index count = bgr.size() / 3;
    for (Index i = 0; i < count; ++i) {
      blue[i] = bgr[3 * i];
      green[i] = bgr[3 * i + 1];
      red[i] = bgr[3 * i + 2];
    }
  }

  void update_value() {
    for (Index i = 0; i < STRIP_PX; ++i) {
      // std::max of the elements themselves is no vector operation
      const std::uint8_t b = blue[i], g = green[i], r = red[i];
      const std::uint8_t v = std::max(std::max(b, g), r);
      value[i] = v;
      spread[i] = v - std::min(std::min(b, g), r);
    }
    for (Index i = 0; i < STRIP_PX; ++i) {
      const std::int16_t b = blue[i], g = green[i], r = red[i], v = value[i], size = spread[i];
      const auto from_green = static_cast<std::int16_t>(b - r + 2 * size);
      const auto from_blue = static_cast<std::int16_t>(r - g + 4 * size);
      const std::int16_t not_red = v == g ? from_green : from_blue;
      sixth[i] = v == r ? static_cast<std::int16_t>(g - b) : not_red;
    }
  }

  // quotients are rounded to 2^-12
  void update_hue_and_saturation() {
    for (Index i = 0; i < STRIP_PX; ++i) {
      const std::int32_t v = value[i], size = spread[i];
      const auto per_v =
          static_cast<std::int32_t>(FULL_SATURATION / static_cast<float>(std::max(v, 1)) + 0.5F);
      const auto per_spread =
          static_cast<std::int32_t>(SIXTH_OF_HUES / static_cast<float>(std::max(size, 1)) + 0.5F);
      wide_saturation[i] = static_cast<std::int16_t>((size * per_v + HALF) >> FRACTION_BITS);
      turn[i] = static_cast<std::int16_t>((sixth[i] * per_spread + HALF) >> FRACTION_BITS);
    }
    for (Index i = 0; i < STRIP_PX; ++i) {
      hue[i] = static_cast<std::uint8_t>(turn[i] + (turn[i] < 0 ? HUES : 0));
      saturation[i] = static_cast<std::uint8_t>(wide_saturation[i]);
    }
  }

  void write_hsv(View<std::uint8_t, 1> hsv) const {
    const Index count = hsv.size() / 3;
    for (Index i = 0; i < count; ++i) {
      hsv[3 * i] = hue[i];
      hsv[3 * i + 1] = saturation[i];
      hsv[3 * i + 2] = value[i];
    }
  }
};

}  // namespace

Array<std::uint8_t, 3> to_hsv(View<const std::uint8_t, 3> image) {
  if (!image.is_contiguous()) return to_hsv(Array<std::uint8_t, 3>(image));
  Array<std::uint8_t, 3> hsv(image.shape());
  const auto bgr_values = image.flat();
  const auto hsv_values = hsv.flat();
  Strip strip{};
  for (Index begin = 0; begin < bgr_values.size(); begin += 3 * STRIP_PX) {
    const Index end = std::min<Index>(begin + 3 * STRIP_PX, bgr_values.size());
    strip.read(bgr_values.slice(begin, end));
    strip.update_value();
    strip.update_hue_and_saturation();
    strip.write_hsv(hsv_values.slice(begin, end));
  }
  return hsv;
}

}  // namespace cmp::image
