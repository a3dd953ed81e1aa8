#include "cells/region_growing.hpp"

namespace cmp::cells {

namespace {

constexpr int HUES = 180;  // OpenCV's 8-bit hue counts in steps of 2 degrees
constexpr std::int32_t BORDER = -1;

// The difference of two hues, unwrapped to the nearer side.
template <class T>
T hue_difference(T hue, T from) {
  const T difference = hue - from;
  const T turn = difference < -HUES / 2 ? HUES : 0, back = difference >= HUES / 2 ? HUES : 0;
  return difference + (turn - back);
}

// Sums of hue, saturation and value, and their means; hue is counted from the seed's.
struct ColorSums {
  std::int64_t seed_hue, hue = 0, saturation, value;
  double mean_hue, mean_saturation, mean_value;

  explicit ColorSums(const std::uint8_t* hsv)
      : seed_hue(hsv[0]),
        saturation(hsv[1]),
        value(hsv[2]),
        mean_hue(hsv[0]),
        mean_saturation(hsv[1]),
        mean_value(hsv[2]) {}

  bool is_similar(const std::uint8_t* hsv, double limit2) const {
    double dh = hue_difference<double>(hsv[0], mean_hue), ds = hsv[1] - mean_saturation,
           dv = hsv[2] - mean_value;
    double scale = (mean_hue + dh) * mean_hue + hsv[1] * mean_saturation + hsv[2] * mean_value;
    return dh * dh + ds * ds + dv * dv < limit2 * scale;
  }
  void add(const std::uint8_t* hsv, bool is_added) {
    hue += is_added * hue_difference<std::int64_t>(hsv[0], seed_hue);
    saturation += is_added * hsv[1];
    value += is_added * hsv[2];
  }
  void update_means(Index count) {
    auto n = static_cast<double>(count);
    mean_hue = static_cast<double>(seed_hue) + static_cast<double>(hue) / n;
    mean_hue += mean_hue < 0.0 ? HUES : mean_hue >= HUES ? -HUES : 0;
    mean_saturation = static_cast<double>(saturation) / n;
    mean_value = static_cast<double>(value) / n;
  }
};

// Replaces each pixel's indices by its x and y; their difference is the number of frame pixels before it.
void update_to_coordinates(View<std::int32_t, 1> queue, View<std::int32_t, 1> framed, Index count,
                           std::int32_t width) {
  for (Index i = 0; i < count; ++i) {
    std::int32_t y = (framed[i] - queue[i] - width - 3) >> 1;
    queue[i] -= y * width;
    framed[i] = y;
  }
}

// Writes a region's moments about (x0, y0); all sums are integers, so that their order does not matter.
void fill_moments(View<const std::int32_t, 1> x_of, View<const std::int32_t, 1> y_of, Index count,
                  std::int32_t x0, std::int32_t y0, View<double, 1> moments) {
  double m1 = 0.0, m2 = 0.0, m3 = 0.0, m4 = 0.0, m5 = 0.0, m6 = 0.0, m7 = 0.0, m8 = 0.0, m9 = 0.0;
#pragma omp simd reduction(+ : m1, m2, m3, m4, m5, m6, m7, m8, m9)
  for (Index i = 0; i < count; ++i) {
    double x = x_of[i] - x0, y = y_of[i] - y0;
    double xx = x * x, yy = y * y;
    m1 += x;
    m2 += y;
    m3 += xx;
    m4 += x * y;
    m5 += yy;
    m6 += xx * x;
    m7 += xx * y;
    m8 += x * yy;
    m9 += yy * y;
  }
  const std::array<double, MOMENT_TERMS> sums{static_cast<double>(count), m1, m2, m3, m4, m5, m6, m7, m8, m9};
  std::copy(sums.begin(), sums.end(), moments.begin());
}

}  // namespace

GrownRegions grow(View<const std::uint8_t, 3> hsv, View<const std::int32_t, 2> seed_xy,
                  View<const std::int64_t, 1> limit_px, const GrowLimits& limits) {
  const auto height = hsv.size(0), width = hsv.size(1), framed_width = width + 2;
  Array<std::int32_t, 2> owner({height + 2, framed_width}, 0);
  owner[0].fill(BORDER);
  owner[height + 1].fill(BORDER);
  for (Index y = 1; y <= height; ++y) owner(y, 0) = owner(y, width + 1) = BORDER;
  Array<double, 2> moments({seed_xy.size(), MOMENT_TERMS}, 0.0);
  std::int64_t most = 0;
  for (const std::int64_t limit : limit_px) most = std::max(most, limit);
  Array<std::int32_t, 1> queue({most + 2});   // indices of pixels in the image
  Array<std::int32_t, 1> framed({most + 2});  // indices of the same pixels in the framed map
  const auto owners = owner.flat(), pixels = queue.view(), framed_pixels = framed.view();
  const auto colors = hsv.flat();
  const std::array<Index, 4> steps{1, -1, width, -width}, framed_steps{1, -1, framed_width, -framed_width};
  const double limit2 = limits.threshold * limits.threshold;
  for (Index region = 0; region < seed_xy.size(); ++region) {
    const std::int32_t sx = seed_xy(region, 0), sy = seed_xy(region, 1);
    const std::int64_t limit = limit_px[region];
    const Index first = sy * width + sx, start = (sy + 1) * framed_width + sx + 1;
    if (owners[start] != 0) continue;
    pixels[0] = static_cast<std::int32_t>(first);
    framed_pixels[0] = static_cast<std::int32_t>(start);
    const auto own = static_cast<std::int32_t>(region + 1);
    owners[start] = own;
    ColorSums sums(&colors[3 * first]);
    Index begin = 0, end = 1;
    while (begin < end && end <= limit) {
      const Index wave_end = end;
      for (Index i = begin; i < wave_end; ++i) {
        for (int side = 0; side < 4; ++side) {
          const Index to = framed_pixels[i] + framed_steps[side];
          if (owners[to] != 0) continue;
          const Index pixel = pixels[i] + steps[side];
          const std::uint8_t* color = &colors[3 * pixel];
          const bool is_added = (end <= limit) & sums.is_similar(color, limit2);
          // a rejected pixel is overwritten: in noise, a branch would be unpredictable
          pixels[end] = static_cast<std::int32_t>(pixel);
          framed_pixels[end] = static_cast<std::int32_t>(to);
          owners[to] = is_added * own;
          end += is_added;
          sums.add(color, is_added);
        }
      }
      begin = wave_end;
      sums.update_means(end);
    }
    if (end > limit) continue;  // a leak or the background: no cell is that large
    update_to_coordinates(pixels, framed_pixels, end, static_cast<std::int32_t>(width));
    fill_moments(pixels, framed_pixels, end, sx, sy, moments[region]);
  }
  return {std::move(owner), std::move(moments)};
}

}  // namespace cmp::cells
