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
    std::uint32_t blue = pixels / 2, green = blue, red = blue;
    for (Index y = 0; y < scale; ++y) {
      const std::uint8_t* values = &rows(y, scale * x, 0);
      for (Index k = 0; k < scale; ++k, values += 3) {
        blue += light_steps[values[0]];
        green += light_steps[values[1]];
        red += light_steps[values[2]];
      }
    }
    means[3 * x] = value_of_steps[blue / pixels];
    means[3 * x + 1] = value_of_steps[green / pixels];
    means[3 * x + 2] = value_of_steps[red / pixels];
  }
}

}  // namespace

Array<double, 2> PyramidLevel::to_level(View<const double, 2> xy_px) const {
  Array<double, 2> out(xy_px.shape());
  for (Index n = 0; n < xy_px.size(); ++n) {
    for (Index axis = 0; axis < 2; ++axis)
      out(n, axis) = (xy_px(n, axis) + 0.5) / static_cast<double>(scale) - 0.5;
  }
  return out;
}

Array<double, 2> PyramidLevel::to_full_scale(View<const double, 2> xy_px) const {
  Array<double, 2> out(xy_px.shape());
  for (Index n = 0; n < xy_px.size(); ++n) {
    for (Index axis = 0; axis < 2; ++axis)
      out(n, axis) = (xy_px(n, axis) + 0.5) * static_cast<double>(scale) - 0.5;
  }
  return out;
}

Array<std::uint8_t, 3> block_means(View<const std::uint8_t, 3> image, Index scale, LightSteps light_steps,
                                   ValueOfSteps value_of_steps) {
  const Index height = image.size(0) / scale, width = image.size(1) / scale;
  Array<std::uint8_t, 3> out({height, width, 3});
  for (Index y = 0; y < height; ++y) {
    const auto rows = image.slice(scale * y, scale * (y + 1));
    const auto means = out[y].flat();
    if (scale == 2)  // with a known number of pixels the loop takes two thirds of the time
      fill_row_of_means(rows, 2, light_steps, value_of_steps, means);
    else if (scale == 3)
      fill_row_of_means(rows, 3, light_steps, value_of_steps, means);
    else
      fill_row_of_means(rows, scale, light_steps, value_of_steps, means);
  }
  return out;
}

}  // namespace cmp::image
