#include "numeric/bilinear_batch.hpp"

#include <cstring>

#include "base/processor.hpp"
#include "numeric/bilinear.hpp"

namespace cmp::numeric {

namespace {

// Writes the flat index of the four pixels around each of the first points, and its sub-pixel parts.
void fill_pixel_indices(Index height, Index width, View<std::int64_t, 1> points, View<float, 1> fractions,
                        Index count) {
  const std::int64_t last_x = width - 2, last_y = height - 2;
  for (Index i = 0; i < count; ++i) {
    const std::int64_t x = points[X + i], y = points[Y + i];
    const std::int64_t ix = std::min(x >> 32, last_x), iy = std::min(y >> 32, last_y);
    points[PIXEL_INDEX + i] = 3 * (iy * width + ix);
    fractions[FRACTION_X + i] =
        static_cast<float>(static_cast<std::int32_t>((x >> 24) - SUBPIXEL_STEPS * ix));
    fractions[FRACTION_Y + i] =
        static_cast<float>(static_cast<std::int32_t>((y >> 24) - SUBPIXEL_STEPS * iy));
  }
}

static_assert(std::endian::native == std::endian::little);

// Four bytes as one number, the first one the lowest.
std::uint32_t read_word(View<const std::uint8_t, 1> flat, Index at) {
  check_index(at + 3, flat.size());
  std::uint32_t word;
  std::memcpy(&word, &flat[at], sizeof word);
  return word;
}

// Reads the first and the last four of the six bytes of two adjacent pixels, and of the two below.
void fill_pixel_words(View<const std::uint8_t, 1> flat, Index width, View<const std::int64_t, 1> points,
                      View<std::uint32_t, 1> words, Index count) {
  const Index below = 3 * width;
  for (Index i = 0; i < count; ++i) {
    const Index k = points[PIXEL_INDEX + i];
    words[i] = read_word(flat, k);
    words[BATCH_POINTS + i] = read_word(flat, k + 2);
    words[2 * BATCH_POINTS + i] = read_word(flat, k + below);
    words[3 * BATCH_POINTS + i] = read_word(flat, k + below + 2);
  }
}

// A byte of a word, number 0 the lowest.
float byte_of(std::uint32_t word, int number) {
  return static_cast<float>(static_cast<std::int32_t>(word >> (8 * number)) & 255);
}

// Writes the channels' weighted sums: integers below 2^24, which float represents exactly.
void fill_channel_sums(View<const std::uint32_t, 1> words, View<float, 1> parts, Index count) {
  constexpr auto STEPS = static_cast<float>(SUBPIXEL_STEPS);
  for (Index i = 0; i < count; ++i) {
    const std::uint32_t a = words[i], b = words[BATCH_POINTS + i];
    const std::uint32_t c = words[2 * BATCH_POINTS + i], d = words[3 * BATCH_POINTS + i];
    const float across = parts[FRACTION_X + i], down = parts[FRACTION_Y + i];
    const float both = across * down;
    const float right = STEPS * across - both, under = STEPS * down - both;
    const float rest = STEPS * (STEPS - across - down) + both;
    parts[BLUE + i] =
        (rest * byte_of(a, 0) + right * byte_of(b, 1)) + (under * byte_of(c, 0) + both * byte_of(d, 1));
    parts[GREEN + i] =
        (rest * byte_of(a, 1) + right * byte_of(b, 2)) + (under * byte_of(c, 1) + both * byte_of(d, 2));
    parts[RED + i] =
        (rest * byte_of(b, 0) + right * byte_of(b, 3)) + (under * byte_of(d, 0) + both * byte_of(d, 3));
  }
}

// Writes a point of the hexagon of every patch; (0, 0) for patches outside the image.
void fill_hexagon_points(double width, double height, const double (&point)[2], View<const double, 1> patches,
                         View<std::int64_t, 1> points, Index count) {
  const double u = point[0], v = point[1];
  for (Index i = 0; i < count; ++i) {
    const double x = patches[X + i] + patches[RADIUS + i] * u, y = patches[Y + i] + patches[RADIUS + i] * v;
    const bool inside = patches[INSIDE + i] > 0.0;
    points[X + i] = fixed_point_coordinate(inside ? std::min(x, width - BORDER_PX) : 0.0);
    points[Y + i] = fixed_point_coordinate(inside ? std::min(y, height - BORDER_PX) : 0.0);
  }
}

// Writes which patches lie in the image, and the color 0.
void begin_patches(double width, double height, View<double, 1> patches, Index count) {
  for (Index i = 0; i < count; ++i) {
    const double x = patches[X + i], y = patches[Y + i], r = patches[RADIUS + i];
    const bool inside = (r >= 0.0) & (x >= r) & (y >= r) & (x <= width - 1.0 - r) & (y <= height - 1.0 - r);
    patches[INSIDE + i] = inside ? 1.0 : 0.0;
  }
  for (Index channel = 0; channel < 3; ++channel) {
    const Index color = COLOR + channel * BATCH_POINTS;
    patches.slice(color, color + count).fill(0.0);
  }
}

}  // namespace

SampleBuffers allocate_sample_buffers() {
  return {Array<std::int64_t, 1>({5 * BATCH_POINTS}, 0), Array<std::uint32_t, 1>({4 * BATCH_POINTS}, 0),
          Array<float, 1>({5 * BATCH_POINTS}, 0.0F), Array<double, 1>({7 * BATCH_POINTS}, 0.0)};
}

void fill_point_samples(View<const std::uint8_t, 1> flat, Index height, Index width, Index count,
                        SampleBuffers& buffers) {
  run_loop<fill_pixel_indices>(height, width, buffers.fixed_points.view(), buffers.channel_sums.view(),
                               count);
  fill_pixel_words(flat, width, buffers.fixed_points, buffers.pixel_words, count);
  fill_channel_sums(buffers.pixel_words, buffers.channel_sums, count);
}

void fill_patch_means(View<const std::uint8_t, 1> flat, Index height, Index width, Index count,
                      SampleBuffers& buffers) {
  const auto patches = buffers.patches.view();
  const auto parts = buffers.channel_sums.view();
  const auto w = static_cast<double>(width), h = static_cast<double>(height);
  begin_patches(w, h, patches, count);
  for (const auto& point : HEXAGON_POINTS) {
    run_loop<fill_hexagon_points>(w, h, point, patches, buffers.fixed_points.view(), count);
    fill_point_samples(flat, height, width, count, buffers);
    for (Index channel = 0; channel < 3; ++channel) {
      const Index column = channel * BATCH_POINTS;
      for (Index i = 0; i < count; ++i) patches[COLOR + column + i] += static_cast<double>(parts[column + i]);
    }
  }
  for (Index channel = 0; channel < 3; ++channel) {
    const Index column = COLOR + channel * BATCH_POINTS;
    for (Index i = 0; i < count; ++i)
      patches[column + i] *= 1.0 / (HEXAGON_COUNT * SUBPIXEL_STEPS * SUBPIXEL_STEPS);
  }
}

Array<double, 2> patch_means(View<const std::uint8_t, 3> image, View<const Patch, 1> patches) {
  Array<double, 2> out({patches.size(), 4});
  SampleBuffers buffers = allocate_sample_buffers();
  const auto columns = buffers.patches.view();
  for (Index first = 0; first < patches.size(); first += BATCH_POINTS) {
    const Index count = std::min(BATCH_POINTS, patches.size() - first);
    for (Index i = 0; i < count; ++i) {
      const auto& [x, y, radius] = patches[first + i];
      columns[X + i] = x, columns[Y + i] = y, columns[RADIUS + i] = radius;
    }
    fill_patch_means(image.flat(), image.size(0), image.size(1), count, buffers);
    for (Index i = 0; i < count; ++i) {
      for (Index k = 0; k < 4; ++k) out(first + i, k) = columns[COLOR + k * BATCH_POINTS + i];
    }
  }
  return out;
}

}  // namespace cmp::numeric
