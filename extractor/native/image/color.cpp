#include "image/color.hpp"

#include <algorithm>
#include <cmath>

namespace cmp::image {

namespace {

constexpr int VALUES = 256;        // of 8 bits
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

  // S V / 255, rounded, in 16 bits
  void write_chroma(View<std::uint8_t, 1> chroma) const {
    const auto count = chroma.size();
    for (Index i = 0; i < count; ++i) {
      const auto product = static_cast<std::uint16_t>(saturation[i] * value[i]);
      chroma[i] = static_cast<std::uint8_t>((product + (product >> 8) + 128) >> 8);
    }
  }
};

// The difference of two angles, unwrapped to the nearer side.
double unwrapped_deg(double difference) { return difference - 360.0 * std::floor(difference / 360.0 + 0.5); }

}  // namespace

HueImages hsv_and_chroma(View<const std::uint8_t, 3> image) {
  if (!image.is_contiguous()) return hsv_and_chroma(Array<std::uint8_t, 3>(image));
  const auto height = image.size(0), width = image.size(1), count = height * width;
  Array<std::uint8_t, 3> hsv({height, width, 3});
  Array<std::uint8_t, 2> hue({height, width}), chroma({height, width});
  const auto bgr_values = image.flat();
  const auto hsv_values = hsv.flat(), hues = hue.flat(), chromas = chroma.flat();
  Strip strip{};
  for (Index begin = 0; begin < count; begin += STRIP_PX) {
    const Index end = std::min(begin + STRIP_PX, count);
    strip.read(bgr_values.slice(3 * begin, 3 * end));
    strip.update_value();
    strip.update_hue_and_saturation();
    strip.write_hsv(hsv_values.slice(3 * begin, 3 * end));
    strip.write_chroma(chromas.slice(begin, end));
    std::copy_n(strip.hue.begin(), end - begin, hues.begin() + begin);
  }
  return {std::move(hsv), std::move(hue), std::move(chroma)};
}

Array<double, 1> hue_weights(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                             const HueLimits& limits) {
  const Index min_chroma = limits.min_chroma;
  std::array<std::int64_t, VALUES> weights{};
  const auto height = hue.size(0), width = hue.size(1);
  for (Index y = 0; y < height; ++y) {
    const auto hues = hue[y], levels = chroma[y];
    for (Index x = 0; x < width; ++x) {
      const Index level = levels[x];
      if (level >= min_chroma) weights[hues[x]] += level;
    }
  }
  Array<double, 1> out({HUES});
  const auto totals = out.view();
  for (Index one = 0; one < HUES; ++one) totals[one] = static_cast<double>(weights[one]);
  return out;
}

FoundHues find_hues(View<const double, 1> weight, View<const double, 1> nominal_deg,
                    const HueLimits& limits) {
  Array<double, 1> shift({INKS}, 0.0);
  for (std::int64_t round = 0; round < limits.rounds; ++round) {
    std::array<double, INKS> total{}, moment{};
    for (Index hue = 0; hue < HUES; ++hue) {
      if (weight[hue] == 0.0) continue;
      double smallest = 360.0;
      Index nearest = 0;
      for (Index ink = 0; ink < INKS; ++ink) {
        const double difference =
            unwrapped_deg(static_cast<double>(hue) * HUE_STEP_DEG - nominal_deg[ink] - shift[ink]);
        if (std::abs(difference) < std::abs(smallest)) {
          smallest = difference;
          nearest = ink;
        }
      }
      if (std::abs(smallest) < limits.width_deg) {
        total[nearest] += weight[hue];
        moment[nearest] += weight[hue] * smallest;
      }
    }
    for (Index ink = 0; ink < INKS; ++ink) {
      if (total[ink] == 0.0) return {std::move(shift), false};
      const double moved = shift[ink] + moment[ink] / total[ink];
      shift[ink] = std::min(std::max(moved, -limits.reach_deg), limits.reach_deg);
    }
  }
  for (Index ink = 0; ink < INKS; ++ink) {
    const double hue_deg = std::fmod(nominal_deg[ink] + shift[ink], 360.0);
    shift[ink] = hue_deg < 0.0 ? hue_deg + 360.0 : hue_deg;
  }
  return {std::move(shift), true};
}

Array<std::uint8_t, 1> ink_of_hue(View<const double, 1> hues_deg, const HueLimits& limits) {
  std::array<double, HUES> smallest, nearest{};
  smallest.fill(limits.ink_width_deg);
  for (Index ink = 0; ink < INKS; ++ink) {
    const double ink_deg = hues_deg[ink];
    for (int hue = 0; hue < HUES; ++hue) {
      const double difference = std::abs(unwrapped_deg(hue * HUE_STEP_DEG - ink_deg));
      const bool is_nearer = difference < smallest[hue];
      smallest[hue] = is_nearer ? difference : smallest[hue];
      nearest[hue] = is_nearer ? static_cast<double>(ink + 1) : nearest[hue];
    }
  }
  Array<std::uint8_t, 1> inks({HUES});
  std::transform(nearest.begin(), nearest.end(), inks.begin(),
                 [](double ink) { return static_cast<std::uint8_t>(ink); });
  return inks;
}

}  // namespace cmp::image
