// The cells of an image: the triangles of the component trees of its contrast maps.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "cells/moments.hpp"

namespace cmp::cells {

// The limits of cells; the Python module explains them.
struct CandidateLimits {
  ShapeLimits shape;
  double min_area_px, max_area_share, same_place, min_contrast_deviations, level_weight;
  std::int64_t tile_px;

  template <class F>
  static CandidateLimits read(const F& f) {
    return {f["shape"],
            f["min_area_px"],
            f["max_area_share"],
            f["same_place"],
            f["min_contrast_deviations"],
            f["level_weight"],
            f["tile_px"]};
  }
};

// centers (N, 2), areas (N,), corners (N, 3, 2) clockwise in the image, qualities (N,) and levels (N,) as
// shares of the local contrast.
using FoundCandidates =
    std::tuple<Array<double, 2>, Array<double, 1>, Array<double, 3>, Array<double, 1>, Array<double, 1>>;

// Cells of the image (H, W, 3), by some of the contrast maps, and by those that
// were found before; of several at one place the one with the best shape.
FoundCandidates find_candidates(View<const std::uint8_t, 3> image, View<const std::int64_t, 1> maps,
                                View<const double, 1> shares, View<const double, 2> center,
                                View<const double, 1> area, View<const double, 3> corner,
                                View<const double, 1> quality, View<const double, 1> share,
                                const CandidateLimits& limits);

}  // namespace cmp::cells
