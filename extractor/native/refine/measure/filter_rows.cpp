#include "refine/measure/filter_rows.hpp"

#include <algorithm>

#include "image/response.hpp"
#include "refine/synthesis/pixel_weights.hpp"

namespace cmp::refine {

namespace {

constexpr float POLYNOMIAL_RANGE = 2.6F;  // in units of the blur, the range of the polynomials
constexpr float SMALLEST = 1e-9F;         // keeps a division finite
constexpr Index BLOCK = 6 * VECTOR_ROWS;  // rows whose columns stay in the fastest memory

// One pixel of every row of a block.
struct BlockStep {
  Index begin, end;  // rows, a whole number of vectors
  Index step;        // the pixel of each row
};

// Fills in the place along the gridline, the density and the places in the table of values.
void fill_densities(const BlockStep& at, float inverse, FilterBuffers& buffers) {
  const FilterRows& rows = buffers.rows;
  RowPixels& pixels = buffers.pixels;
  const auto step = static_cast<float>(at.step);
  for (Index i = at.begin; i < at.end; ++i) {
    const float keep = step <= rows.last[i] ? 1.0F : 0.0F;
    const float t = (rows.along[i] + step * rows.along_step[i]) * rows.inverse_length[i];
    const float s = 1.0F - t;
    const float off = rows.length[i] * (t * s * (rows.leave[i] * s - rows.arrive[i] * t));
    float z = (rows.across[i] + step * rows.across_step[i] - off) * inverse;
    z = std::min(std::max(z, -POLYNOMIAL_RANGE), POLYNOMIAL_RANGE);
    const float zz = z * z;
    pixels.along[i] = t;
    pixels.density[i] = keep * (C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))));
    const float half = half_share(z);
    pixels.place[0][i] = image::table_place(rows.foot[0][i] + rows.contrast[0][i] * half);
    pixels.place[1][i] = image::table_place(rows.foot[1][i] + rows.contrast[1][i] * half);
    pixels.place[2][i] = image::table_place(rows.foot[2][i] + rows.contrast[2][i] * half);
  }
}

// Looks up the values of the image and of the drawn light.
void fill_values(const BlockStep& at, const FilterImage& image, FilterBuffers& buffers) {
  const FilterRows& rows = buffers.rows;
  RowPixels& pixels = buffers.pixels;
  const auto flat = image.flat;
  const auto encoded = image.encoded;
  for (Index i = at.begin; i < at.end; ++i) {
    const Index pixel = std::min(rows.first[i] + at.step * rows.step[i], rows.end[i]);
    for (Index channel = 0; channel < CHANNELS; ++channel) {
      const Index entry = pixels.place[channel][i];
      pixels.observed[channel][i] = flat[pixel + channel];
      pixels.drawn[channel][i] = encoded[entry];
      pixels.slope[channel][i] = encoded[entry + 1];
    }
  }
}

// Adds the pixels to the sums of their rows.
void accumulate_sums(const BlockStep& at, FilterBuffers& buffers) {
  const FilterRows& rows = buffers.rows;
  RowPixels& pixels = buffers.pixels;
  RowSums& sums = buffers.sums;
  const auto step = static_cast<float>(at.step);
  for (Index i = at.begin; i < at.end; ++i) {
    const auto r0 = static_cast<float>(pixels.observed[0][i]) - pixels.drawn[0][i];
    const auto r1 = static_cast<float>(pixels.observed[1][i]) - pixels.drawn[1][i];
    const auto r2 = static_cast<float>(pixels.observed[2][i]) - pixels.drawn[2][i];
    const float d0 = rows.contrast[0][i] * pixels.slope[0][i];
    const float d1 = rows.contrast[1][i] * pixels.slope[1][i];
    const float d2 = rows.contrast[2][i] * pixels.slope[2][i];
    const float pull = d0 * r0 + d1 * r1 + d2 * r2;
    const float own = d0 * d0 + d1 * d1 + d2 * d2;
    const float keep = step <= rows.last[i] ? 1.0F : 0.0F;
    const float t = pixels.along[i], g = pixels.density[i], s = 1.0F - t;
    sums.pixels[i] += keep;
    sums.misfit[i] += keep * pull * pull / std::max(own, SMALLEST);
    const float a = g * s, b = g * t;
    const float by_a = own * a, by_b = own * b;
    sums.a[i] += static_cast<double>(a * pull);
    sums.b[i] += static_cast<double>(b * pull);
    sums.aa[i] += static_cast<double>(a * by_a);
    sums.ab[i] += static_cast<double>(a * by_b);
    sums.bb[i] += static_cast<double>(b * by_b);
    pixels.pull[i] = pull;
    pixels.information[i] = own;
  }
}

// The same for the sums of the bending.
void accumulate_bending_sums(const BlockStep& at, FilterBuffers& buffers) {
  const RowPixels& pixels = buffers.pixels;
  RowSums& sums = buffers.sums;
  for (Index i = at.begin; i < at.end; ++i) {
    const float t = pixels.along[i], g = pixels.density[i], s = 1.0F - t;
    const float pull = pixels.pull[i], own = pixels.information[i];
    const float a = g * s, b = g * t, c = a * t, d = c * (s - t);
    const float by_c = own * c, by_d = own * d;
    sums.c[i] += c * pull;
    sums.d[i] += d * pull;
    sums.ac[i] += a * by_c;
    sums.ad[i] += a * by_d;
    sums.bc[i] += b * by_c;
    sums.bd[i] += b * by_d;
    sums.cc[i] += c * by_c;
    sums.cd[i] += c * by_d;
    sums.dd[i] += d * by_d;
  }
}

}  // namespace

void fill_row_sums(const FilterImage& image, Index count, bool is_any_bending, FilterBuffers& buffers) {
  buffers.sums = RowSums{};
  for (Index begin = 0; begin < count; begin += BLOCK) {
    BlockStep at{begin, std::min(count, begin + BLOCK), 0};
    std::int32_t last = -1;
    for (Index i = at.begin; i < at.end; ++i)
      last = std::max(last, static_cast<std::int32_t>(buffers.rows.last[i]));
    for (; at.step <= last; ++at.step) {
      fill_densities(at, image.inverse_sigma, buffers);
      fill_values(at, image, buffers);
      accumulate_sums(at, buffers);
      if (is_any_bending) accumulate_bending_sums(at, buffers);
    }
  }
}

}  // namespace cmp::refine
