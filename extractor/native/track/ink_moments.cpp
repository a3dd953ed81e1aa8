#include "track/ink_moments.hpp"

#include <bit>
#include <cstring>

namespace cmp::track {

namespace {

// The four bytes from a place on as one number, the first the lowest.
std::uint32_t read_word(const std::uint8_t& first) {
  static_assert(std::endian::native == std::endian::little);
  std::uint32_t word;
  std::memcpy(&word, &first, sizeof(word));
  return word;
}

// The same of the three bytes of one pixel.
std::uint32_t pixel_word(View<const std::uint8_t, 1> pixel) {
  const std::uint32_t blue = pixel[0], green = pixel[1], red = pixel[2];
  return blue | green << 8 | red << 16;
}

float byte_of(std::uint32_t word, int number) {
  return static_cast<float>(static_cast<std::int32_t>(word >> (8 * number)) & 255);
}

}  // namespace

Index append_pixels(View<const std::uint8_t, 1> flat, Index width, Index y, Index x, Index end,
                    PixelBlock& block) {
  const Index count = std::min(end - x, BLOCK_PIXELS - block.count), begin = block.count;
  const Index first = 3 * (y * width + x);
  const bool is_last =
      first + 3 * count == flat.size();  // four bytes from the image's last pixel on are too many
  const View<std::uint32_t, 1> color(block.color.data(), {BLOCK_PIXELS});
  const View<std::int32_t, 1> xs(block.x.data(), {BLOCK_PIXELS}), ys(block.y.data(), {BLOCK_PIXELS});
  for (Index k = 0; k < count - is_last; ++k) color[begin + k] = read_word(flat[first + 3 * k]);
  if (is_last) color[begin + count - 1] = pixel_word(flat.from(flat.size() - 3));
  for (Index k = 0; k < count; ++k) {
    xs[begin + k] = static_cast<std::int32_t>(x + k);
    ys[begin + k] = static_cast<std::int32_t>(y);
  }
  block.count += count;
  return x + count;
}

void add_ink_moments(const PixelBlock& block, double x, double y, const InkWeights& ink, InkMoments& sums) {
  const auto w0 = static_cast<float>(ink.weights[0]), w1 = static_cast<float>(ink.weights[1]),
             w2 = static_cast<float>(ink.weights[2]);
  const auto zero = static_cast<float>(ink.zero), least = static_cast<float>(ink.least);
  // from a whole pixel on, as small numbers are differences of large ones
  const auto x0 = static_cast<std::int32_t>(x), y0 = static_cast<std::int32_t>(y);
  const auto from_x = static_cast<float>(x - x0), from_y = static_cast<float>(y - y0);
  float total = 0.0F, moment_x = 0.0F, moment_y = 0.0F;
  const View<const std::uint32_t, 1> color(block.color.data(), {BLOCK_PIXELS});
  const View<const std::int32_t, 1> xs(block.x.data(), {BLOCK_PIXELS}), ys(block.y.data(), {BLOCK_PIXELS});
  for (Index k = 0; k < block.count; ++k) {
    const std::uint32_t word = color[k];
    float share = w0 * byte_of(word, 0) + w1 * byte_of(word, 1) + w2 * byte_of(word, 2) - zero;
    share = std::min(share, 1.0F) * static_cast<float>(share > least);
    total += share;
    moment_x += share * (static_cast<float>(xs[k] - x0) - from_x);
    moment_y += share * (static_cast<float>(ys[k] - y0) - from_y);
  }
  sums.area += static_cast<double>(total);
  sums.x += static_cast<double>(moment_x);
  sums.y += static_cast<double>(moment_y);
}

}  // namespace cmp::track
