#include "image/contrast_maps.hpp"

#include <cmath>
#include <functional>

#include "base/processor.hpp"

namespace cmp::image {

namespace {

constexpr Index CHANNELS = 3;
// The weights of blue, green and red in each map, and the divisor and the offset that keep it within 0 to
// 255.
struct Mix {
  std::int32_t blue, green, red, divisor, offset;
};
constexpr std::array<Mix, 7> MIXES{{{1, 0, 0, 1, 0},
                                                {0, 1, 0, 1, 0},
                                                {0, 0, 1, 1, 0},
                                                {1, 1, 1, 3, 0},
                                                {2, -1, -1, 4, 128},
                                                {-1, 2, -1, 4, 128},
                                                {-1, -1, 2, 4, 128}}};
constexpr Index NOISE_STRIDE = 3;          // of the rows and columns in which noise is measured, for time
constexpr double QUANTILE = 0.3;           // of the differences' sizes
constexpr double NORMAL_QUANTILE = 0.385;  // the same of a normal distribution

using Line = View<std::uint16_t, 1>;

// Splits a row of pixels into its channels, with the first and the last value twice.
CMP_PART_OF_LOOP void split(const std::uint8_t* from, Index width, Line blue, Line green, Line red) {
  for (Index x = 0; x < width; ++x) {
    blue[x + 1] = from[CHANNELS * x];
    green[x + 1] = from[CHANNELS * x + 1];
    red[x + 1] = from[CHANNELS * x + 2];
  }
  for (const Line& line : {blue, green, red}) {
    line[0] = line[1];
    line[width + 1] = line[width];
  }
}

CMP_PART_OF_LOOP void fill_sums(View<const std::uint16_t, 1> values, Line sums) {
  for (Index x = 0; x < sums.size(); ++x)
    sums[x] = static_cast<std::uint16_t>(values[x] + 2 * values[x + 1] + values[x + 2]);
}

CMP_PART_OF_LOOP void fill_smoothed_row(View<const std::uint16_t, 1> above, View<const std::uint16_t, 1> here,
                                        View<const std::uint16_t, 1> below, View<std::uint8_t, 1> out) {
  for (Index x = 0; x < out.size(); ++x)
    out[x] = static_cast<std::uint8_t>((above[x] + 2 * here[x] + below[x] + 8) >> 4);
}

CMP_PART_OF_LOOP void fill_mixed(View<const std::uint8_t, 1> blue, View<const std::uint8_t, 1> green,
                                 View<const std::uint8_t, 1> red, const Mix& mix, View<std::uint8_t, 1> out) {
  const std::int32_t factor = 65536 / mix.divisor;
  for (Index i = 0; i < out.size(); ++i) {
    const std::int32_t sum = mix.blue * blue[i] + mix.green * green[i] + mix.red * red[i];
    out[i] = static_cast<std::uint8_t>(((sum * factor) >> 16) + mix.offset);
  }
}

CMP_PART_OF_LOOP void fill_over_least(View<const std::uint8_t, 1> blue, View<const std::uint8_t, 1> green,
                                      View<const std::uint8_t, 1> red, View<const std::uint8_t, 1> own,
                                      View<std::uint8_t, 1> out) {
  for (Index i = 0; i < out.size(); ++i)
    out[i] = static_cast<std::uint8_t>(own[i] - std::min({blue[i], green[i], red[i]}));
}

CMP_PART_OF_LOOP std::uint8_t least_of(View<const std::uint8_t, 1> values) {
  std::uint8_t least = 255;
  for (Index i = 0; i < values.size(); ++i) least = std::min(least, values[i]);
  return least;
}

CMP_PART_OF_LOOP std::uint8_t largest_of(View<const std::uint8_t, 1> values) {
  std::uint8_t largest = 0;
  for (Index i = 0; i < values.size(); ++i) largest = std::max(largest, values[i]);
  return largest;
}

// The least and largest value of each tile.
CMP_PART_OF_LOOP void fill_tile_levels(View<const std::uint8_t, 2> map, Index tile_px, View<float, 2> low,
                                       View<float, 2> high) {
  const Index width = map.size(1);
  Array<std::uint8_t, 1> least({width}), most({width});
  const auto least_line = least.view(), most_line = most.view();
  for (Index ty = 0; ty < low.size(); ++ty) {
    least_line.fill(255);
    most_line.fill(0);
    for (Index y = ty * tile_px; y < std::min((ty + 1) * tile_px, map.size(0)); ++y) {
      const auto row = map[y];
      for (Index x = 0; x < width; ++x) {
        least_line[x] = std::min(least_line[x], row[x]);
        most_line[x] = std::max(most_line[x], row[x]);
      }
    }
    for (Index tx = 0; tx < low.size(1); ++tx) {
      const Index begin = tx * tile_px, end = std::min(begin + tile_px, width);
      low(ty, tx) = least_of(least_line.slice(begin, end));
      high(ty, tx) = largest_of(most_line.slice(begin, end));
    }
  }
}

// Replaces each tile by what `combine` makes of it and the tiles around it, and `finish` of that and their
// number.
template <class Combine, class Finish>
void update_by_neighbours(Array<float, 2>& tiles, Combine combine, Finish finish) {
  const Array<float, 2> from(tiles.view());
  const Index rows = tiles.size(), columns = tiles.size(1);
  for (Index y = 0; y < rows; ++y) {
    const Index top = std::max<Index>(y - 1, 0), bottom = std::min(y + 1, rows - 1);
    for (Index x = 0; x < columns; ++x) {
      const Index left = std::max<Index>(x - 1, 0), right = std::min(x + 1, columns - 1);
      float value = from(top, left);
      for (Index i = left + 1; i <= right; ++i) value = combine(value, from(top, i));
      for (Index j = top + 1; j <= bottom; ++j)
        for (Index i = left; i <= right; ++i) value = combine(value, from(j, i));
      tiles(y, x) = finish(value, static_cast<float>((bottom - top + 1) * (right - left + 1)));
    }
  }
}

}  // namespace

Array<std::uint8_t, 3> smoothed_channels(View<const std::uint8_t, 3> image) {
  const Index height = image.size(0), width = image.size(1);
  Array<std::uint8_t, 3> out({CHANNELS, height, width});
  Array<std::uint16_t, 3> sums({3, CHANNELS, width});
  Array<std::uint16_t, 2> lines({CHANNELS, width + 2});
  const auto fill = [&](Index y) {
    split(&image(std::min(std::max<Index>(y, 0), height - 1), 0, 0), width, lines[0], lines[1], lines[2]);
    for (Index c = 0; c < CHANNELS; ++c) fill_sums(lines[c], sums[(y + 3) % 3][c]);
  };
  fill(-1);
  fill(0);
  for (Index y = 0; y < height; ++y) {
    fill(y + 1);
    for (Index c = 0; c < CHANNELS; ++c)
      fill_smoothed_row(sums[(y + 2) % 3][c], sums[y % 3][c], sums[(y + 1) % 3][c], out[c][y]);
  }
  return out;
}

ContrastMap contrast_map(View<const std::uint8_t, 3> channels, Index number, Index tile_px) {
  const Index height = channels.size(1), width = channels.size(2);
  const Index rows = (height + tile_px - 1) / tile_px, columns = (width + tile_px - 1) / tile_px;
  ContrastMap out{Array<std::uint8_t, 2>({height, width}), Array<float, 2>({rows, columns}),
                  Array<float, 2>({rows, columns}), tile_px};
  const auto blue = channels[0].flat(), green = channels[1].flat(), red = channels[2].flat();
  if (number < static_cast<Index>(MIXES.size()))
    fill_mixed(blue, green, red, MIXES[number], out.value.flat());
  else
    fill_over_least(blue, green, red, channels[number - static_cast<Index>(MIXES.size())].flat(),
                    out.value.flat());
  fill_tile_levels(out.value, tile_px, out.low, out.high);
  const auto as_is = [](float value, float) { return value; };
  const auto sum = [](float a, float b) { return a + b; };
  update_by_neighbours(out.low, [](float a, float b) { return std::min(a, b); }, as_is);
  update_by_neighbours(out.high, [](float a, float b) { return std::max(a, b); }, as_is);
  update_by_neighbours(out.low, sum, std::divides<float>());
  update_by_neighbours(out.high, sum, std::divides<float>());
  return out;
}

double channel_noise(View<const std::uint8_t, 3> channels) {
  double most = 0.0;
  for (Index c = 0; c < CHANNELS; ++c) {
    std::array<std::int32_t, 1024> counts{};
    std::int32_t total = 0;
    const auto map = channels[c];
    for (Index y = 0; y + 2 < map.size(0); y += NOISE_STRIDE)
      for (Index x = 0; x + 2 < map.size(1); x += NOISE_STRIDE) {
        ++counts[std::abs(map(y, x) - map(y, x + 2) - map(y + 2, x) + map(y + 2, x + 2))];
        ++total;
      }
    std::int32_t below = 0, k = 0;
    while (k < 1023 && below + counts[k] < QUANTILE * total) below += counts[k++];
    const double share = counts[k] > 0 ? (QUANTILE * total - below) / counts[k] : 0.0;
    most = std::max(most, (k == 0 ? 0.5 * share : k - 0.5 + share) / (2.0 * NORMAL_QUANTILE));
  }
  return most;
}

}  // namespace cmp::image
