#include "image/input.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace cmp::image {

namespace {

// x and y of the pixels that are sampled around a cell's middle, in this order
constexpr std::array<std::array<Index, 2>, 9> NEIGHBOUR_PIXELS{
    {{0, 0}, {1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
constexpr Index REACH_PX = 2;                // of the sampled pixels' masks from a cell's middle
constexpr std::int32_t LARGEST = 255;        // value of 8 bits
constexpr Index MASK_SUM = 8;                // of the positive weights of the mask
constexpr double MASK_GAIN = 6.0;            // from the noise to the deviation of the mask's response
constexpr double MEDIAN_OF_NORMAL = 0.6745;  // of the size of a normal variable with deviation 1

// The mask's response at a pixel of one channel; -1 where one of its pixels is clipped.
std::int32_t response_at(View<const std::uint8_t, 3> image, Index x, Index y, Index channel) {
  std::int32_t response = 0, low = LARGEST, high = 0;
  for (Index dy = -1; dy < 2; ++dy) {
    const std::uint8_t* const pixels = &image(y + dy, x - 1, channel);
    const std::int32_t left = pixels[0], middle = pixels[3], right = pixels[6];
    low = std::min(std::min(low, left), std::min(middle, right));
    high = std::max(std::max(high, left), std::max(middle, right));
    const std::int32_t row = left - 2 * middle + right;
    response += dy == 0 ? -2 * row : row;
  }
  return low > 0 && high < LARGEST ? std::abs(response) : -1;
}

}  // namespace

double estimate_noise(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                      View<const std::int32_t, 2> cells, const NoiseLimits& limits) {
  std::array<std::int64_t, MASK_SUM * LARGEST + 1> counts{};
  std::int64_t total = 0;
  const auto most = static_cast<Index>(NEIGHBOUR_PIXELS.size());
  const Index samples = std::clamp<Index>(limits.samples / std::max<Index>(cells.size(), 1), 1, most);
  const auto right = static_cast<double>(image.size(1) - REACH_PX - 1) - 0.5;
  const auto bottom = static_cast<double>(image.size(0) - REACH_PX - 1) - 0.5;
  for (Index i = 0; i < cells.size(); ++i) {
    const Index a = cells(i, 0), b = cells(i, 1), c = cells(i, 2);
    const double cx = (xy(a, 0) + xy(b, 0) + xy(c, 0)) / 3, cy = (xy(a, 1) + xy(b, 1) + xy(c, 1)) / 3;
    if (!(cx > REACH_PX + 0.5 && cy > REACH_PX + 0.5 && cx < right && cy < bottom)) continue;
    for (Index k = 0; k < samples; ++k) {
      const Index x = static_cast<Index>(cx + 0.5) + NEIGHBOUR_PIXELS[k][0];
      const Index y = static_cast<Index>(cy + 0.5) + NEIGHBOUR_PIXELS[k][1];
      for (Index channel = 0; channel < 3; ++channel) {
        const std::int32_t response = response_at(image, x, y, channel);
        if (response < 0) continue;
        ++counts[response];
        ++total;
      }
    }
  }
  if (total == 0) return std::numeric_limits<double>::quiet_NaN();
  const double half = 0.5 * static_cast<double>(total);
  std::int64_t below = 0;
  Index bin = 0;
  while (static_cast<double>(below + counts[bin]) < half) below += counts[bin++];
  // responses are integers: each represents the interval of half a step on both sides
  const double median =
      static_cast<double>(bin) - 0.5 + (half - static_cast<double>(below)) / static_cast<double>(counts[bin]);
  return std::max(median, 0.0) / (MASK_GAIN * MEDIAN_OF_NORMAL);
}

}  // namespace cmp::image
