// The check of predicted cells by the image: a cell must show its own ink inside and none of it across its
// edges.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Verdicts on a cell.
inline constexpr std::uint8_t UNSEEN = 0, CONTRADICTED = 1, CONFIRMED = 2;

// Limits of the check.
struct CheckLimits {
  // of the white cell's brightness (sum of the channels) to an ink's; black is below. Derived: as in
  // WhiteSearchLimits.
  double min_white_ratio = 0.75;
  // between an ink level over black and the same cell's a frame ago, of a confirmed cell. Chosen.
  double min_cosine = 0.8;
  // of the ink level over black of a confirmed cell, relative to the same cell's a frame ago. Chosen.
  double min_strength = 0.4, max_strength = 2.5;
  // of the second samples of the ink, as a share of the way from the middle to a corner. Chosen.
  double inner_sample_position = 0.5;
  // of the ink level at these samples, relative to the middle; across an edge to a black cell it must be
  // less. Chosen.
  double min_inner_strength = 0.4;
  // of the disc over which the ink is averaged, relative to the distance of a corner. Chosen.
  double level_radius = 0.15;
  // of ink levels, to divide by. Derived: it only keeps a division from failing.
  double smallest_square = 1e-9;
};

// The check of C cells.
struct CellCheck {
  Array<std::uint8_t, 1> verdict;  // (C,)
  Array<double, 3> cell_levels;    // (2, C, 3)
  // edges across which the white cell is bright, is not bright, and a black cell is as bright as white
  std::int64_t white_count, white_missing_count, white_elsewhere_count;
};

// The check of the cells with the corners xy (C, 3, 2), NaN where not predicted.
//
// image (H, W, 3) BGR; before (C, 3) ink levels over black in the previous frame, used if `compare`.
CellCheck check_cells(View<const std::uint8_t, 3> image, View<const double, 3> xy, const WarmTables& tables,
                      View<const double, 2> before, bool compare, const CheckLimits& limits);

}  // namespace cmp::track
