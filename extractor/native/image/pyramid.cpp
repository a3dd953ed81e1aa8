#include "image/pyramid.hpp"

#include <algorithm>

namespace cmp::image {

namespace {

using Row = View<const std::uint8_t, 1>;
using LightSteps = View<const std::uint16_t, 1>;
using ValueOfSteps = View<const std::uint8_t, 1>;

// Writes or adds the light of a row of values.
template <bool IS_ADDED>
void fill_light(Row values, LightSteps light_steps, View<std::uint32_t, 1> light) {
  const auto count = values.size();
  for (Index i = 0; i < count; ++i) light[i] = light_steps[values[i]] + (IS_ADDED ? light[i] : 0);
}

// Writes the sums of `scale` adjacent pixels of a row into total (3 * width,), all channels at once.
void fill_block_sums(View<const std::uint32_t, 1> column, Index scale, View<std::uint32_t, 1> total) {
  const auto count = total.size();
  Index i = 0;
  for (Index x = 0; x < count; x += 3) {
    std::uint32_t blue = 0, green = 0, red = 0;
    for (Index k = 0; k < scale; ++k, i += 3) {
      blue += column[i];
      green += column[i + 1];
      red += column[i + 2];
    }
    total[x] = blue;
    total[x + 1] = green;
    total[x + 2] = red;
  }
}

// Writes the values of the mean light of blocks, of each of which `share` is one pixel's.
void fill_values(View<const std::uint32_t, 1> total, float share, ValueOfSteps value_of_steps,
                 View<std::uint8_t, 1> values) {
  const auto count = values.size();
  for (Index i = 0; i < count; ++i) {
    const auto step = static_cast<std::uint32_t>(static_cast<float>(total[i]) * share + 0.5F);
    values[i] = value_of_steps[std::min<std::uint32_t>(step, LIGHT_STEPS - 1)];
  }
}

}  // namespace

Array<std::uint8_t, 3> block_means(View<const std::uint8_t, 3> image, Index scale, LightSteps light_steps,
                                   ValueOfSteps value_of_steps) {
  const Index height = image.size(0) / scale, width = image.size(1) / scale;
  Array<std::uint8_t, 3> out({height, width, 3});
  Array<std::uint32_t, 1> column({3 * image.size(1)}), total({3 * width});
  const auto share = static_cast<float>(1.0 / static_cast<double>(scale * scale));
  for (Index y = 0; y < height; ++y) {
    fill_light<false>(image[scale * y].flat(), light_steps, column);
    for (Index k = 1; k < scale; ++k) fill_light<true>(image[scale * y + k].flat(), light_steps, column);
    fill_block_sums(column, scale, total);
    fill_values(total, share, value_of_steps, out[y].flat());
  }
  return out;
}

Array<std::uint8_t, 3> halved(View<const std::uint8_t, 3> image, LightSteps light_steps,
                              ValueOfSteps value_of_steps) {
  const Index height = image.size(0) / 2, width = image.size(1) / 2;
  Array<std::uint8_t, 3> out({height, width, 3});
  for (Index y = 0; y < height; ++y) {
    const auto above = image[2 * y].flat(), below = image[2 * y + 1].flat();
    const auto line = out[y].flat();
    for (Index x = 0; x < width; ++x) {
      for (Index channel = 0; channel < 3; ++channel) {
        const Index k = 6 * x + channel;
        const std::uint32_t left = light_steps[above[k]] + light_steps[below[k]];
        const std::uint32_t right = light_steps[above[k + 3]] + light_steps[below[k + 3]];
        line[3 * x + channel] = value_of_steps[(left + right + 2) >> 2];
      }
    }
  }
  return out;
}

}  // namespace cmp::image
