// Bilinear samples of an image at many sub-pixel points together, in branch-free loops.
//
// The samples equal those of bilinear.hpp to the last bit. Places are fixed-point numbers, 2^-32 px.
#pragma once

#include "base/array.hpp"
#include "numeric/bilinear.hpp"

namespace cmp::numeric {

inline constexpr double FIXED_POINT_ONE = 4294967296.0;  // one pixel
inline constexpr std::int64_t HALF_STEP = 1 << 23;       // 0.5 / SUBPIXEL_STEPS px
inline constexpr Index BATCH_POINTS = 192;               // points sampled together at most
// Begins of columns: of `fixed_points`,
inline constexpr Index X = 0, Y = BATCH_POINTS, PIXEL_INDEX = 2 * BATCH_POINTS;
inline constexpr Index STEP_X = 3 * BATCH_POINTS, STEP_Y = 4 * BATCH_POINTS;
// of `channel_sums`,
inline constexpr Index BLUE = 0, GREEN = BATCH_POINTS, RED = 2 * BATCH_POINTS;
inline constexpr Index FRACTION_X = 3 * BATCH_POINTS, FRACTION_Y = 4 * BATCH_POINTS;
// and with X and Y of `patches`.
inline constexpr Index RADIUS = 2 * BATCH_POINTS, COLOR = 3 * BATCH_POINTS, INSIDE = 6 * BATCH_POINTS;

// Memory for P = BATCH_POINTS samples; every array consists of columns of P.
struct SampleBuffers {
  // (5 P,) columns X and Y, by fixed_point_coordinate, PIXEL_INDEX, the flat index of the first of four
  // pixels, and STEP_X and STEP_Y, from one point to the next, by fixed_point_length
  Array<std::int64_t, 1> fixed_points;
  Array<std::uint32_t, 1> pixel_words;  // (4 P,) bytes of the four pixels
  // (5 P,) columns BLUE, GREEN and RED, each channel times the square of SUBPIXEL_STEPS, and FRACTION_X and
  // FRACTION_Y, the sub-pixel parts in steps
  Array<float, 1> channel_sums;
  // (7 P,) columns X, Y and RADIUS, px, three of COLOR, and INSIDE, 1 in the image, else 0
  Array<double, 1> patches;
};

// A coordinate as an integer multiple of 2^-32 px, plus half a sub-pixel step, so that truncation rounds it.
inline std::int64_t fixed_point_coordinate(double place_px) {
  return static_cast<std::int64_t>(place_px * FIXED_POINT_ONE) + HALF_STEP;
}

// A length as an integer multiple of 2^-32 px.
inline std::int64_t fixed_point_length(double length_px) {
  return static_cast<std::int64_t>(length_px * FIXED_POINT_ONE);
}

// The whole value next to a channel's sum.
inline std::int32_t nearest_value(float sum) {
  constexpr std::int32_t ONE = SUBPIXEL_STEPS * SUBPIXEL_STEPS;
  return (static_cast<std::int32_t>(sum) + ONE / 2) / ONE;
}

// SampleBuffers of zeros.
SampleBuffers allocate_sample_buffers();

// Samples the image at the first `count` fixed points of the buffers, which must lie in the image.
void fill_point_samples(View<const std::uint8_t, 1> flat, Index height, Index width, Index count,
                        SampleBuffers& buffers);

// fill_patch_mean of bilinear.hpp for the first `count` patches of the buffers.
void fill_patch_means(View<const std::uint8_t, 1> flat, Index height, Index width, Index count,
                      SampleBuffers& buffers);

// A patch of the image, px.
struct Patch {
  double x, y, radius;
};

// (N, 4) the means of fill_patch_mean, and 1 for patches in the image (H, W, 3), else 0.
Array<double, 2> patch_means(View<const std::uint8_t, 3> image, View<const Patch, 1> patches);

}  // namespace cmp::numeric
