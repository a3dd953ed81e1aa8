// The cells of an image: the triangles of the component trees of its contrast maps.
#pragma once

#include "base/array.hpp"
#include "cells/moments.hpp"

namespace cmp::cells {

// Limits of cells.
struct CandidateLimits {
  ShapeLimits shape;
  double min_area_px = 12.0;         // px^2 at the scale of recognition: edges of 5 px. Chosen.
  double max_area_share = 1.0 / 30;  // of the image. Chosen.
  // in edges, of the distance within which two regions are one cell; neighbours are an edge apart. Chosen.
  double same_place = 0.42;
  double min_contrast_deviations = 7.0;  // least contrast, in standard deviations of the noise. Chosen.
  // in the quality, of the logarithm of a region's level over half of its contrast, where the true outline
  // is. Chosen.
  double level_weight = 0.35;
};

struct FoundCells {
  Array<double, 2> centre_px;  // (N, 2)
  Array<double, 1> area_px;    // (N,) px^2
  Array<double, 3> corner_px;  // (N, 3, 2) clockwise in the image
  Array<double, 1> quality;    // (N,)
  Array<double, 1> share;      // (N,) the level, as a share of the local contrast

  CMP_RECORD("extractor.cells.cells.Cells", centre_px, area_px, corner_px, quality, share)
};

// Cells that were found before.
struct KnownCells {
  View<const double, 2> centre_px;
  View<const double, 1> area_px;
  View<const double, 3> corner_px;
  View<const double, 1> quality, share;

  CMP_RECORD("extractor.cells.cells.Cells", centre_px, area_px, corner_px, quality, share)
};

// Cells of the image (H, W, 3), by some of the contrast maps at some shares of the local contrast, and
// by those that were found before; of several at one place the one with the best shape. tile_px: of the tiles
// of local levels.
FoundCells find_candidates(View<const std::uint8_t, 3> image, View<const std::int64_t, 1> maps,
                           View<const double, 1> shares, const KnownCells& known, Index tile_px,
                           const CandidateLimits& limits);

}  // namespace cmp::cells
