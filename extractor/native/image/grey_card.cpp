#include "image/grey_card.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

namespace cmp::image {

namespace {

constexpr Index CHANNELS = 3;
// planes of the statistics
constexpr Index MEAN = 0, SMALLEST = 3, SQUARE = 6, PRODUCT = 9, PLANES = 12;
// planes of what is smoothed: means and blacks times weights, and the weights
constexpr Index BLACK = 3, WEIGHT = 6, WEIGHTED_PLANES = 7;
constexpr double WHITE = 255.0;  // the largest value
constexpr double REACH = 3.0;    // of the smoothing, in sigmas

using Plane = View<const float, 2>;

// Writes each tile's value combined with those of its eight neighbours; combine(one, nothing) is `one`.
template <class Combine>
void fill_combined(Plane plane, double nothing, Combine combine, View<double, 2> out) {
  const auto rows = plane.size(0), columns = plane.size(1);
  Array<double, 1> padded({columns + 2}, nothing);
  const auto line = padded.view();
  for (Index row = 0; row < rows; ++row) {
    std::fill_n(line.begin() + 1, columns, nothing);
    for (Index y = std::max<Index>(row - 1, 0); y < std::min(row + 2, rows); ++y) {
      const auto own = plane[y];
      for (Index x = 0; x < columns; ++x) line[x + 1] = combine(line[x + 1], static_cast<double>(own[x]));
    }
    const auto combined = out[row];
    for (Index x = 0; x < columns; ++x) combined[x] = combine(combine(line[x], line[x + 1]), line[x + 2]);
  }
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

// (12, rows, columns): the statistics' means over each tile and its neighbours.
Array<double, 3> neighbourhood_means(View<const float, 3> statistics) {
  const Array<float, 2> ones({statistics.size(1), statistics.size(2)}, 1.0F);
  Array<double, 2> tiles(ones.shape());
  fill_combined(ones, 0.0, std::plus<>(), tiles);
  Array<double, 3> means(statistics.shape());
  for (Index plane = 0; plane < PLANES; ++plane) {
    fill_combined(statistics[plane], 0.0, std::plus<>(), means[plane]);
    const auto mean = means[plane].flat(), count = tiles.flat();
    for (Index i = 0; i < mean.size(); ++i) mean[i] /= count[i];
  }
  return means;
}

// How independently the channels vary around each tile of a row: the sum, over the pairs of channels, of the
// product of their deviations less their covariance. It is 0 where all channels vary alike.
Array<double, 1> independent_variation(View<const double, 3> means, Index row) {
  const auto columns = means.size(2);
  Array<double, 1> variation({columns}, 0.0);
  Array<double, 2> deviation({CHANNELS, columns});
  for (Index c = 0; c < CHANNELS; ++c) {
    const auto mean = means[MEAN + c][row], square = means[SQUARE + c][row];
    const auto own = deviation[c];
    for (Index x = 0; x < columns; ++x) own[x] = std::sqrt(std::max(square[x] - mean[x] * mean[x], 0.0));
  }
  for (Index c = 0; c < CHANNELS; ++c) {
    const Index next = (c + 1) % CHANNELS;
    const auto mean = means[MEAN + c][row], other = means[MEAN + next][row],
               product = means[PRODUCT + c][row];
    const auto own = deviation[c], others = deviation[next], total = variation.view();
    for (Index x = 0; x < columns; ++x) {
      const double covariance = product[x] - mean[x] * other[x];
      total[x] += std::max(own[x] * others[x] - covariance, 0.0);
    }
  }
  return variation;
}

// Weights (rows, columns) from 0 to 1: 1/2 where the variation is a share of the typical one, which is the
// mean weighted by the variation itself, so that it does not matter how much of the image the pattern fills.
Array<float, 2> pattern_weights(View<const float, 3> statistics, double half_share) {
  const auto rows = statistics.size(1), columns = statistics.size(2);
  const auto means = neighbourhood_means(statistics);
  Array<float, 2> weight({rows, columns});
  double total = 0.0, squares = 0.0;
  for (Index row = 0; row < rows; ++row) {
    const auto variation = independent_variation(means, row);
    for (Index x = 0; x < columns; ++x) {
      weight(row, x) = static_cast<float>(variation[x]);
      const double one = weight(row, x);
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
  Array<double, 2> black({rows, columns});
  const auto darkest = [](double one, double other) { return std::min(one, other); };
  for (Index c = 0; c < CHANNELS; ++c) {
    fill_combined(statistics[SMALLEST + c], WHITE, darkest, black);
    for (Index row = 0; row < rows; ++row) {
      for (Index column = 0; column < columns; ++column) {
        const float own = weight(row, column);
        planes(MEAN + c, row, column) = own * statistics(MEAN + c, row, column);
        planes(BLACK + c, row, column) = own * static_cast<float>(black(row, column));
      }
    }
  }
  copy(weight, planes[WEIGHT]);
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

// The ratio of the strongest channel's mean over black, in the whole pattern, to the weakest one's; total:
// the sums of the weighted planes.
double pattern_ratio(const std::array<double, WEIGHTED_PLANES>& total, double min_level) {
  LocalLevels whole{};
  for (Index c = 0; c < CHANNELS; ++c) {
    whole.mean[c] = total[MEAN + c] / total[WEIGHT];
    whole.black[c] = total[BLACK + c] / total[WEIGHT];
  }
  return LocalLight(whole, min_level).ratio();
}

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
  const double ratio = pattern_ratio(total, limits.min_level);
  if (ratio <= limits.white_ratio) return {std::move(gain), std::move(offset), ratio};
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
