#include "cells/edge_profiles.hpp"

#include <cmath>

#include "base/processor.hpp"
#include "image/response.hpp"
#include "numeric/bilinear.hpp"

namespace cmp::cells {

namespace {

using image::light_at;
using numeric::BATCH_POINTS;

// Writes the inks' colors from the cells' middles.
void fill_ink_colors(const ProfileImage& image, View<double, 1> edges, Index cells,
                     numeric::SampleBuffers& buffers, double radius) {
  const auto patches = buffers.patches.view();
  for (Index i = 0; i < cells; ++i) {
    patches[numeric::X + i] = edges[CENTRE_X + i];
    patches[numeric::Y + i] = edges[CENTRE_Y + i];
    patches[numeric::RADIUS + i] = radius * edges[SIZE + i];
  }
  numeric::fill_patch_means(image.flat, image.height, image.width, cells, buffers);
  for (Index k = 0; k < 3; ++k) {
    for (Index i = 0; i < cells; ++i) {
      edges[VALID + k * cells + i] = patches[numeric::INSIDE + i];
      for (Index channel = 0; channel < 3 * BATCH_POINTS; channel += BATCH_POINTS)
        edges[INK + channel + k * cells + i] = patches[numeric::COLOR + channel + i];
    }
  }
}

// Writes the background's colors into the buffers' patches.
void fill_background_colors(const ProfileImage& image, View<double, 1> edges, Index count,
                            numeric::SampleBuffers& buffers, double place, double radius) {
  const auto patches = buffers.patches.view();
  for (Index i = 0; i < count; ++i) {
    patches[numeric::X + i] = edges[CENTRE_X + i] + place * edges[MEDIAN_X + i];
    patches[numeric::Y + i] = edges[CENTRE_Y + i] + place * edges[MEDIAN_Y + i];
    patches[numeric::RADIUS + i] = radius * edges[DEPTH + i];
  }
  numeric::fill_patch_means(image.flat, image.height, image.width, count, buffers);
}

// Writes the fixed-point beginnings and steps of the first or second profiles; 0 for invalid edges.
void fill_profile_starts(bool second, View<const double, 1> edges, Index count, double reach, double half,
                         View<std::int64_t, 1> points) {
  const Index middle_x = second ? SECOND_X : FIRST_X, middle_y = second ? SECOND_Y : FIRST_Y;
  for (Index i = 0; i < count; ++i) {
    const bool is_valid = edges[VALID + i] > 0.0;
    const double step = is_valid ? reach / half : 0.0;
    const double x = edges[middle_x + i] - reach * edges[MEDIAN_X + i];
    const double y = edges[middle_y + i] - reach * edges[MEDIAN_Y + i];
    points[numeric::X + i] = numeric::fixed_point_coordinate(is_valid ? x : 0.0);
    points[numeric::Y + i] = numeric::fixed_point_coordinate(is_valid ? y : 0.0);
    points[numeric::STEP_X + i] = numeric::fixed_point_length(step * edges[MEDIAN_X + i]);
    points[numeric::STEP_Y + i] = numeric::fixed_point_length(step * edges[MEDIAN_Y + i]);
  }
}

}  // namespace

void fill_contrast_weights(const ProfileImage& image, View<double, 1> edges, Index count,
                           numeric::SampleBuffers& buffers, const TriangleEdgeLimits& limits) {
  fill_ink_colors(image, edges, count / 3, buffers, limits.ink_radius);
  fill_background_colors(image, edges, count, buffers, limits.background_place, limits.background_radius);
  const auto patches = buffers.patches.view();
  const auto light = image.light;
  const double min_contrast2 = limits.min_contrast * limits.min_contrast, min_depth = limits.min_depth_px;
  const double smallest = limits.smallest_contrast;
  for (Index i = 0; i < count; ++i) {
    const double b0 = patches[numeric::COLOR + i], b1 = patches[numeric::COLOR + BATCH_POINTS + i];
    const double b2 = patches[numeric::COLOR + 2 * BATCH_POINTS + i];
    const double i0 = edges[INK + i], i1 = edges[INK + BATCH_POINTS + i],
                 i2 = edges[INK + 2 * BATCH_POINTS + i];
    const double u0 = i0 - b0, u1 = i1 - b1, u2 = i2 - b2;
    const bool is_valid = (u0 * u0 + u1 * u1 + u2 * u2 >= min_contrast2) & (edges[DEPTH + i] > min_depth);
    edges[VALID + i] *= patches[numeric::INSIDE + i] * is_valid;
    const float dark0 = light_at(light, b0), dark1 = light_at(light, b1), dark2 = light_at(light, b2);
    const float d0 = light_at(light, i0) - dark0, d1 = light_at(light, i1) - dark1;
    const float d2 = light_at(light, i2) - dark2;
    const double contrast = std::max<double>(d0 * d0 + d1 * d1 + d2 * d2, smallest);
    const double w0 = d0 / contrast, w1 = d1 / contrast, w2 = d2 / contrast;
    edges[WEIGHT + i] = w0, edges[WEIGHT + BATCH_POINTS + i] = w1, edges[WEIGHT + 2 * BATCH_POINTS + i] = w2;
    edges[BACKGROUND + i] = w0 * dark0 + w1 * dark1 + w2 * dark2;
  }
}

void fill_profile_places(const ProfileImage& image, View<double, 1> edges, Index count,
                         const TriangleEdgeLimits& limits) {
  const double right = static_cast<double>(image.width) - 1.0 - limits.border_margin_px;
  const double bottom = static_cast<double>(image.height) - 1.0 - limits.border_margin_px;
  const double share = limits.first_profile, reach = limits.profile_reach;
  for (Index i = 0; i < count; ++i) {
    const double dx = share * (edges[END_X + i] - edges[START_X + i]);
    const double dy = share * (edges[END_Y + i] - edges[START_Y + i]);
    const double x = edges[START_X + i] + dx, y = edges[START_Y + i] + dy;
    const double end_x = edges[END_X + i] - dx, end_y = edges[END_Y + i] - dy;
    const double wide = reach * std::abs(edges[MEDIAN_X + i]);
    const double high = reach * std::abs(edges[MEDIAN_Y + i]);
    edges[FIRST_X + i] = x, edges[FIRST_Y + i] = y;
    edges[SECOND_X + i] = end_x, edges[SECOND_Y + i] = end_y;
    const bool is_inside = (std::min(x, end_x) >= wide) & (std::min(y, end_y) >= high) &
                           (std::max(x, end_x) + wide < right) & (std::max(y, end_y) + high < bottom);
    edges[VALID + i] *= is_inside;
  }
}

void fill_profile_areas(const ProfileImage& image, bool second, View<double, 1> edges, Index count,
                        numeric::SampleBuffers& buffers, const TriangleEdgeLimits& limits) {
  const auto points = buffers.fixed_points.view();
  const auto parts = buffers.channel_sums.view();
  const auto light = image.light;
  const auto half = static_cast<double>(limits.half_profile);
  const double lowest = limits.min_profile_level, highest = limits.max_profile_level;
  run_loop<fill_profile_starts>(second, edges, count, limits.profile_reach, half, points);
  for (Index i = 0; i < count; ++i) {
    edges[AREA_BEFORE + i] = edges[AREA + i];
    edges[AREA + i] = 0.0;
  }
  const Index last = 2 * limits.half_profile;
  for (Index m = 0; m <= last; ++m) {
    const double weight = m == 0 || m == last ? 0.5 : 1.0;
    numeric::fill_point_samples(image.flat, image.height, image.width, count, buffers);
    for (Index i = 0; i < count; ++i) {
      const double u0 = edges[WEIGHT + i], u1 = edges[WEIGHT + BATCH_POINTS + i];
      const double u2 = edges[WEIGHT + 2 * BATCH_POINTS + i];
      double f = u0 * light[numeric::nearest_value(parts[numeric::BLUE + i])] +
                 u1 * light[numeric::nearest_value(parts[numeric::GREEN + i])];
      f += u2 * light[numeric::nearest_value(parts[numeric::RED + i])] - edges[BACKGROUND + i];
      edges[AREA + i] += weight * std::min(std::max(f, lowest), highest);
    }
    for (Index i = 0; i < count; ++i) {
      points[numeric::X + i] += points[numeric::STEP_X + i];
      points[numeric::Y + i] += points[numeric::STEP_Y + i];
    }
  }
}

}  // namespace cmp::cells
