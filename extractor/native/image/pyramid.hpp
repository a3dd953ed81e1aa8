// An image at reduced scales: blurred or large images need no fine pixels.
#pragma once

#include "base/array.hpp"
#include "image/response.hpp"

namespace cmp::image {

// The coordinates of polynomials over an image: (px - x) / scale, (py - y) / scale, for a pixel (px, py).
struct PolynomialFrame {
  double x, y, scale;

  CMP_FIELDS(x, y, scale)
};

// An image at 1/scale of the full size.
struct PyramidLevel {
  View<const std::uint8_t, 3> image;  // (H, W, 3) the values of the mean light of scale x scale pixels
  Index scale;                        // full-scale pixels per pixel
  PolynomialFrame frame;              // the coordinates of polynomials over this image
  ResponseTables response;            // from values to light

  // Points (N, 2) px of the full image in this one.
  Array<double, 2> to_level(View<const double, 2> xy_px) const;
  // Points (N, 2) px of this one in the full image.
  Array<double, 2> to_full_scale(View<const double, 2> xy_px) const;

  CMP_RECORD("extractor.image.pyramid.PyramidLevel", image, scale, frame, response)
};

// (H // scale, W // scale, 3): the values of the mean light of scale x scale pixels; image (H, W, 3).
Array<std::uint8_t, 3> block_means(View<const std::uint8_t, 3> image, Index scale,
                                   View<const std::uint16_t, 1> light_steps,
                                   View<const std::uint8_t, 1> value_of_steps);

}  // namespace cmp::image
