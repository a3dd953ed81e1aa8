// An estimate of an image's noise.
#pragma once

#include "base/array.hpp"

namespace cmp::image {

// Limits of the estimate of the noise.
struct NoiseLimits {
  std::int64_t samples = 600;  // pixels for the estimate; with fewer cells, several pixels in each. Chosen.
};

// Standard deviation of a channel's noise in gray levels (Immerkaer 1996, with a median for robustness); NaN
// where no cell lies within the image.
//
// The Laplacian-like mask [1 -2 1; -2 4 -2; 1 -2 1] ignores gradients; its response to noise is 6 sigma. It
// is applied to all channels in the middles of cells, where no pixel is clipped.
//
// image (H, W, 3); xy (M, 2) markers, px; cells (K, 3) marker ids of the cells' corners.
double estimate_noise(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                      View<const std::int32_t, 2> cells, const NoiseLimits& limits);

}  // namespace cmp::image
