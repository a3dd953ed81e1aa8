#include "image/grey_card.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace cmp::image {

namespace {

constexpr Index CHANNELS = 3;
// planes of the statistics
constexpr Index MEAN = 0, SMALLEST = 3, SQUARE = 6, PRODUCT = 9, PLANES = 12;
// planes of what is smoothed: means and blacks times weights, and the weights
constexpr Index BLACK = 3, WEIGHT = 6, WEIGHTED_PLANES = 7;
constexpr double REACH = 3.0;  // of the smoothing, in sigmas

using Plane = View<const float, 2>;

// Calls visit(y, x) for the tile and its neighbours.
template <class Visit>
void for_neighbours(Index row, Index column, Index rows, Index columns, Visit visit) {
  for (Index y = std::max<Index>(row - 1, 0); y < std::min(row + 2, rows); ++y)
    for (Index x = std::max<Index>(column - 1, 0); x < std::min(column + 2, columns); ++x) visit(y, x);
}

// The sums of one tile.
struct TileSums {
  std::array<std::int64_t, PLANES> sum{};
  std::array<std::uint8_t, CHANNELS> smallest{255, 255, 255};
  std::int64_t count = 0;

  void add(const std::uint8_t* pixel) {
    const std::int64_t blue = pixel[0], green = pixel[1], red = pixel[2];
    const std::array<std::int64_t, CHANNELS> value{blue, green, red};
    for (Index c = 0; c < CHANNELS; ++c) {
      sum[MEAN + c] += value[c];
      sum[SQUARE + c] += value[c] * value[c];
      smallest[c] = std::min(smallest[c], pixel[c]);
    }
    sum[PRODUCT] += blue * green;
    sum[PRODUCT + 1] += green * red;
    sum[PRODUCT + 2] += red * blue;
    ++count;
  }
};

// How independently the channels vary around a tile: the sum, over the pairs of channels, of the product of
// their deviations less their covariance. It is 0 where all channels vary alike.
float independent_variation(View<const float, 3> statistics, Index row, Index column) {
  std::array<double, PLANES> mean{};
  double count = 0.0;
  for_neighbours(row, column, statistics.size(1), statistics.size(2), [&](Index y, Index x) {
    for (Index plane = 0; plane < PLANES; ++plane) mean[plane] += statistics(plane, y, x);
    count += 1.0;
  });
  for (double& one : mean) one /= count;
  std::array<double, CHANNELS> deviation{};
  for (Index c = 0; c < CHANNELS; ++c)
    deviation[c] = std::sqrt(std::max(mean[SQUARE + c] - mean[MEAN + c] * mean[MEAN + c], 0.0));
  double total = 0.0;
  for (Index c = 0; c < CHANNELS; ++c) {
    const Index other = (c + 1) % CHANNELS;
    const double covariance = mean[PRODUCT + c] - mean[MEAN + c] * mean[MEAN + other];
    total += std::max(deviation[c] * deviation[other] - covariance, 0.0);
  }
  return static_cast<float>(total);
}

// Weights (rows, columns) from 0 to 1: 1/2 where the variation is a share of the typical one, which is the
// mean weighted by the variation itself, so that it does not matter how much of the image the pattern fills.
Array<float, 2> pattern_weights(View<const float, 3> statistics, double half_share) {
  const auto rows = statistics.size(1), columns = statistics.size(2);
  Array<float, 2> weight({rows, columns});
  double total = 0.0, squares = 0.0;
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      const double one = independent_variation(statistics, row, column);
      weight(row, column) = static_cast<float>(one);
      total += one;
      squares += one * one;
    }
  }
  const double half = total > 0.0 ? half_share * squares / total : 0.0;
  for (float& one : weight) {
    const double square = static_cast<double>(one) * one;
    one = half > 0.0 ? static_cast<float>(square / (square + half * half)) : 0.0F;
  }
  return weight;
}

// Adds `share` times a row, displaced by `shift` places, to another one.
void add_shifted(View<const float, 1> from, Index shift, float share, View<float, 1> to) {
  const Index begin = std::max<Index>(-shift, 0), end = std::min(to.size(), to.size() - shift);
  for (Index x = begin; x < end; ++x) to[x] += share * from[x + shift];
}

// The plane under a Gaussian, with zeros around it.
Array<float, 2> smoothed(Plane plane, const std::vector<float>& half_kernel) {
  const auto rows = plane.size(0), columns = plane.size(1);
  const auto reach = static_cast<Index>(half_kernel.size()) - 1;
  Array<float, 2> across({rows, columns}, 0.0F), out({rows, columns}, 0.0F);
  for (Index row = 0; row < rows; ++row)
    for (Index shift = -reach; shift <= reach; ++shift)
      add_shifted(plane[row], shift, half_kernel[std::abs(shift)], across[row]);
  for (Index row = 0; row < rows; ++row)
    for (Index y = std::max<Index>(row - reach, 0); y < std::min(row + reach + 1, rows); ++y)
      add_shifted(across[y], 0, half_kernel[std::abs(y - row)], out[row]);
  return out;
}

std::vector<float> gaussian_half_kernel(double sigma, Index longest) {
  const Index reach = std::min(static_cast<Index>(std::ceil(REACH * sigma)), longest);
  std::vector<float> kernel;
  for (Index x = 0; x <= reach; ++x) {
    const double distance = static_cast<double>(x) / sigma;
    kernel.push_back(static_cast<float>(std::exp(-0.5 * distance * distance)));
  }
  return kernel;
}

// Means, blacks (the smallest values around) and weights, times the weights.
Array<float, 3> weighted_planes(View<const float, 3> statistics, View<const float, 2> weight) {
  const auto rows = statistics.size(1), columns = statistics.size(2);
  Array<float, 3> planes({WEIGHTED_PLANES, rows, columns});
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      const float own = weight(row, column);
      planes(WEIGHT, row, column) = own;
      for (Index c = 0; c < CHANNELS; ++c) {
        float black = 255.0F;
        for_neighbours(row, column, rows, columns,
                       [&](Index y, Index x) { black = std::min(black, statistics(SMALLEST + c, y, x)); });
        planes(MEAN + c, row, column) = own * statistics(MEAN + c, row, column);
        planes(BLACK + c, row, column) = own * black;
      }
    }
  }
  return planes;
}

double sum_of(Plane plane) {
  double total = 0.0;
  for (Index row = 0; row < plane.size(0); ++row)
    for (float one : plane[row]) total += one;
  return total;
}

// Mean and black of each channel at one tile.
struct LocalLevels {
  std::array<double, CHANNELS> mean, black;
};

// The color of the light at one tile.
struct LocalLight {
  std::array<double, CHANNELS> level;  // of each channel over black
  std::array<double, CHANNELS> black;
  double strongest = 0.0, weakest = 0.0, lowest_black = 0.0;

  LocalLight(const LocalLevels& levels, double min_level) : black(levels.black) {
    for (Index c = 0; c < CHANNELS; ++c) level[c] = std::max(levels.mean[c] - levels.black[c], min_level);
    strongest = *std::max_element(level.begin(), level.end());
    weakest = *std::min_element(level.begin(), level.end());
    lowest_black = *std::min_element(black.begin(), black.end());
  }

  double ratio() const { return strongest / weakest; }

  double gain(Index channel, const GreyCardLimits& limits) const {
    const double wanted = strongest / (level[channel] * limits.ink_ratio);
    return std::min(std::max(wanted, 1.0), limits.max_gain);
  }
};

// The tiles whose middles lie before and behind a pixel along one axis.
struct TilePair {
  Index first, second;
  float share;  // of the second one

  TilePair(Index pixel, double tile_px, Index tiles) {
    const double place = (static_cast<double>(pixel) + 0.5) / tile_px - 0.5;
    const double inside = std::min(std::max(place, 0.0), static_cast<double>(tiles - 1));
    first = static_cast<Index>(inside);
    second = std::min(first + 1, tiles - 1);
    share = static_cast<float>(inside - static_cast<double>(first));
  }

  float between(float one, float two) const { return one + share * (two - one); }
};

// Writes a row (columns,) of a field to the pixels (width,) of one channel, which lie 3 apart.
void fill_across(View<const float, 1> tiles, double tile_px, Index channel, View<float, 1> pixels) {
  const Index width = pixels.size() / CHANNELS;
  for (Index x = 0; x < width; ++x) {
    const TilePair pair(x, tile_px, tiles.size());
    pixels[CHANNELS * x + channel] = pair.between(tiles[pair.first], tiles[pair.second]);
  }
}

// (rows, 3 W): a field at all pixels of the rows of tiles.
Array<float, 2> spread_across(View<const float, 3> field, double tile_px, Index width) {
  Array<float, 2> out({field.size(1), CHANNELS * width});
  for (Index row = 0; row < out.size(); ++row)
    for (Index c = 0; c < CHANNELS; ++c) fill_across(field[c][row], tile_px, c, out[row]);
  return out;
}

}  // namespace

Array<float, 3> tile_statistics(View<const std::uint8_t, 3> image, Index tile_px, Index step) {
  const auto height = image.size(0), width = image.size(1);
  const Index rows = (height + tile_px - 1) / tile_px, columns = (width + tile_px - 1) / tile_px;
  Array<float, 3> out({PLANES, rows, columns});
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      TileSums sums;
      const Index end = std::min((column + 1) * tile_px, width);
      for (Index y = row * tile_px; y < std::min((row + 1) * tile_px, height); y += step) {
        const auto pixels = image[y];
        for (Index x = column * tile_px; x < end; x += step) sums.add(&pixels(x, 0));
      }
      for (Index plane = 0; plane < PLANES; ++plane)
        out(plane, row, column) = static_cast<float>(sums.sum[plane]) / static_cast<float>(sums.count);
      for (Index c = 0; c < CHANNELS; ++c) out(SMALLEST + c, row, column) = sums.smallest[c];
    }
  }
  return out;
}

GreyCardFields grey_card_fields(View<const float, 3> statistics, const GreyCardLimits& limits) {
  const auto rows = statistics.size(1), columns = statistics.size(2);
  Array<float, 3> gain({CHANNELS, rows, columns}, 1.0F), offset({CHANNELS, rows, columns}, 0.0F);
  const auto weight = pattern_weights(statistics, limits.half_weight_share);
  const auto planes = weighted_planes(statistics, weight);
  std::array<double, WEIGHTED_PLANES> total{};
  for (Index plane = 0; plane < WEIGHTED_PLANES; ++plane) total[plane] = sum_of(planes[plane]);
  if (!(total[WEIGHT] > 0.0)) return {std::move(gain), std::move(offset), 1.0};
  const double sigma = limits.sigma_share * static_cast<double>(std::min(rows, columns));
  const auto half_kernel = gaussian_half_kernel(sigma, std::max(rows, columns));
  double kernel_sum = -1.0;
  for (float one : half_kernel) kernel_sum += 2.0 * one;
  // far from the pattern the mean of the whole pattern counts
  const double rest =
      limits.rest_weight_share * kernel_sum * kernel_sum / static_cast<double>(rows * columns);
  std::array<Array<float, 2>, WEIGHTED_PLANES> smooth;
  for (Index plane = 0; plane < WEIGHTED_PLANES; ++plane)
    smooth[plane] = smoothed(planes[plane], half_kernel);
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      const auto local = [&](Index plane) {
        return (smooth[plane](row, column) + rest * total[plane]) /
               (smooth[WEIGHT](row, column) + rest * total[WEIGHT]);
      };
      LocalLevels levels{};
      for (Index c = 0; c < CHANNELS; ++c) {
        levels.mean[c] = local(MEAN + c);
        levels.black[c] = local(BLACK + c);
      }
      const LocalLight light(levels, limits.min_level);
      for (Index c = 0; c < CHANNELS; ++c) {
        const double factor = light.gain(c, limits);
        gain(c, row, column) = static_cast<float>(factor);
        offset(c, row, column) = static_cast<float>(light.lowest_black - light.black[c] * factor);
      }
    }
  }
  LocalLevels whole{};
  for (Index c = 0; c < CHANNELS; ++c) {
    whole.mean[c] = total[MEAN + c] / total[WEIGHT];
    whole.black[c] = total[BLACK + c] / total[WEIGHT];
  }
  const double ratio = LocalLight(whole, limits.min_level).ratio();
  return {std::move(gain), std::move(offset), ratio};
}

Array<std::uint8_t, 3> with_fields(View<const std::uint8_t, 3> image, View<const float, 3> gain,
                                   View<const float, 3> offset, double tile_px) {
  const auto height = image.size(0), width = image.size(1);
  const auto gains = spread_across(gain, tile_px, width), offsets = spread_across(offset, tile_px, width);
  Array<std::uint8_t, 3> out({height, width, CHANNELS});
  for (Index y = 0; y < height; ++y) {
    const TilePair pair(y, tile_px, gain.size(1));
    const auto upper_gain = gains[pair.first], lower_gain = gains[pair.second];
    const auto upper_offset = offsets[pair.first], lower_offset = offsets[pair.second];
    const auto values = image[y].flat();
    const auto line = out[y].flat();
    const auto count = line.size();
    for (Index x = 0; x < count; ++x) {
      const float value = static_cast<float>(values[x]) * pair.between(upper_gain[x], lower_gain[x]) +
                          pair.between(upper_offset[x], lower_offset[x]);
      line[x] = static_cast<std::uint8_t>(std::min(std::max(value, 0.0F), 255.0F) + 0.5F);
    }
  }
  return out;
}

}  // namespace cmp::image
