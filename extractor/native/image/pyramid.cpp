#include "image/pyramid.hpp"

#include "base/processor.hpp"

namespace cmp::image {

namespace {

using LightSteps = View<const std::uint16_t, 1>;
using ValueOfSteps = View<const std::uint8_t, 1>;

// Writes a row (3 * width,) of block_means; rows: the `scale` rows of its blocks.
CMP_PART_OF_LOOP void fill_row_of_means(View<const std::uint8_t, 3> rows, Index scale, LightSteps light_steps,
                                        ValueOfSteps value_of_steps, View<std::uint8_t, 1> means) {
  const auto pixels = static_cast<std::uint32_t>(scale * scale);
  const auto width = means.size() / 3;
  for (Index x = 0; x < width; ++x) {
    for (Index channel = 0; channel < 3; ++channel) {
      std::uint32_t total = 0;
      for (Index y = 0; y < scale; ++y) {
        const auto values = rows[y].flat();
        for (Index k = 0; k < scale; ++k) total += light_steps[values[3 * (scale * x + k) + channel]];
      }
      means[3 * x + channel] = value_of_steps[(total + pixels / 2) / pixels];
    }
  }
}

}  // namespace

Array<std::uint8_t, 3> block_means(View<const std::uint8_t, 3> image, Index scale, LightSteps light_steps,
                                   ValueOfSteps value_of_steps) {
  const Index height = image.size(0) / scale, width = image.size(1) / scale;
  Array<std::uint8_t, 3> out({height, width, 3});
  for (Index y = 0; y < height; ++y) {
    const auto rows = image.slice(scale * y, scale * (y + 1));
    const auto means = out[y].flat();
    if (scale == 2)  // with a known number of pixels the loop takes less than half of the time
      fill_row_of_means(rows, 2, light_steps, value_of_steps, means);
    else if (scale == 3)
      fill_row_of_means(rows, 3, light_steps, value_of_steps, means);
    else
      fill_row_of_means(rows, scale, light_steps, value_of_steps, means);
  }
  return out;
}

}  // namespace cmp::image
