#include "numbering/whiteness.hpp"

#include <cmath>
#include <limits>

#include "numeric/bilinear_batch.hpp"
#include "numeric/median.hpp"

namespace cmp::numbering {

namespace {

using numeric::BATCH_POINTS;
using numeric::COLOR;
using numeric::INSIDE;
using numeric::RADIUS;
using numeric::X;
using numeric::Y;

constexpr int INKS = 4;  // none, red, green, blue
constexpr int CHANNELS = 3;
constexpr double ONE_STEP = 1.0;  // least divisor, one step of a channel

struct Shade {
  double brightness, whiteness;
};

// The brightness of patch n relative to the inks around, and its whiteness; writes its color (3,).
Shade fill_patch_color(View<const double, 1> patches, Index n, double level, View<const double, 1> strongest,
                       bool is_far, View<double, 1> color) {
  if (!(patches[INSIDE + n] > 0.0)) return {0.0, 0.0};
  double total = 0.0, weakest = std::numeric_limits<double>::infinity();
  for (int channel = 0; channel < CHANNELS; ++channel) {
    color[channel] = patches[COLOR + channel * BATCH_POINTS + n];
    const double share = color[channel] / std::max(strongest[channel], ONE_STEP);
    total += color[channel];
    weakest = std::min(weakest, share);
  }
  return {is_far ? weakest : total / std::max(level, ONE_STEP), weakest};
}

}  // namespace

MeasuredInks measure_inks(View<const std::uint8_t, 3> image, View<const double, 2> center,
                          View<const double, 1> area, View<const std::uint8_t, 1> ink,
                          View<const std::int64_t, 1> known, const WhitenessLimits& limits) {
  const Index count = known.size();
  Array<double, 1> radius({count}), level({count}, std::numeric_limits<double>::quiet_NaN());
  Array<double, 3> samples({INKS, CHANNELS, count});
  std::array<Index, INKS> filled{};
  auto buffers = numeric::allocate_sample_buffers();
  const auto patches = buffers.patches.view();
  for (Index first = 0; first < count; first += BATCH_POINTS) {
    const Index here = std::min<Index>(count - first, BATCH_POINTS);
    for (Index n = 0; n < here; ++n) {
      const std::int64_t i = known[first + n];
      radius[first + n] = limits.sample_radius * std::sqrt(area[i]);
      patches[X + n] = center(i, 0);
      patches[Y + n] = center(i, 1);
      patches[RADIUS + n] = radius[first + n];
    }
    numeric::fill_patch_means(image.flat(), image.size(0), image.size(1), here, buffers);
    for (Index n = 0; n < here; ++n) {
      if (!(patches[INSIDE + n] > 0.0)) continue;
      const std::uint8_t own = ink[known[first + n]];
      double total = 0.0;
      for (int channel = 0; channel < CHANNELS; ++channel) {
        const double value = patches[COLOR + channel * BATCH_POINTS + n];
        samples(own, channel, filled[own]) = value;
        total += value;
      }
      ++filled[own];
      level[first + n] = total;
    }
  }
  Array<double, 2> colors({INKS, CHANNELS}, 0.0);
  Array<double, 1> strongest({CHANNELS}, 0.0);
  for (int channel = 0; channel < CHANNELS; ++channel)
    for (int c = 1; c < INKS; ++c) {
      if (filled[c] == 0) continue;
      colors(c, channel) = numeric::median_of_many(samples[c][channel].slice(0, filled[c]));
      strongest[channel] = std::max(strongest[channel], colors(c, channel));
    }
  return {std::move(radius), std::move(level), std::move(colors), std::move(strongest)};
}

PlaceColors measure_whiteness(View<const std::uint8_t, 3> image, View<const double, 2> means,
                              View<const double, 1> strongest, bool is_far) {
  const Index count = means.size();
  PlaceColors out{Array<double, 1>({count}), Array<double, 1>({count}),
                  Array<double, 2>({count, CHANNELS}, 0.0)};
  auto buffers = numeric::allocate_sample_buffers();
  const auto patches = buffers.patches.view();
  for (Index first = 0; first < count; first += BATCH_POINTS) {
    const Index here = std::min<Index>(count - first, BATCH_POINTS);
    for (Index n = 0; n < here; ++n) {
      const auto mean = means[first + n];
      patches[X + n] = mean[0];
      patches[Y + n] = mean[1];
      patches[RADIUS + n] = mean[2];
    }
    numeric::fill_patch_means(image.flat(), image.size(0), image.size(1), here, buffers);
    for (Index n = 0; n < here; ++n) {
      const Shade shade =
          fill_patch_color(patches, n, means(first + n, 3), strongest, is_far, out.color[first + n]);
      out.brightness[first + n] = shade.brightness;
      out.whiteness[first + n] = shade.whiteness;
    }
  }
  return out;
}

}  // namespace cmp::numbering
