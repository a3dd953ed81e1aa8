// Bleed: the blur brings the neighbours' levels into a cell's middle. Levels with the bleed removed, or
// adapted.
//
// A level is the mean of a disc in the middle of the cell. Each of the three neighbours has a share in that
// mean, which depends on the distance from the disc to the side between the cells, in units of the blur.
#pragma once

#include "base/array.hpp"
#include "refine/synthesis/ink_levels.hpp"

namespace cmp::refine {

// Limits of bleed.
struct BleedLimits {
  double max_bleed = 0.1;  // share of a neighbour in a cell's mean, the most that is corrected. Chosen.
  DiscLimits disc;
};

// (K,) the share of each neighbour in the means of the cells, NaN where a corner is unknown; and their
// median.
using BleedShares = std::tuple<Array<double, 1>, double>;

// xy (M, 2) px; cells (K, 3) marker ids; sigma px, the blur; assumed_sigma px, the blur that cell_means was
// called with.
BleedShares bleed_shares(View<const double, 2> xy, View<const std::int32_t, 2> cells, double sigma,
                         double assumed_sigma, const BleedLimits& limits);

// The levels without bleed.
//
// A colored cell has three black neighbours, a black cell has a red, a green and a blue one. Over black, the
// mean of a colored cell is therefore (1 - 3 b) of its level less b times the sum of the three inks' levels.
// The sum of the means is 1 - 6 b of that sum. color (K,) the cells' inks; share (K,), b, the share of each
// neighbour; median_share stands for NaN.
LevelArrays remove_bleed(const InkLevels& levels, View<const std::int32_t, 1> color,
                         View<const double, 1> share, double median_share, const BleedLimits& limits);

// The levels that the cells' middles show with the blur `sigma` instead of `drawn_sigma`, px.
//
// levels, that they show with drawn_sigma; xy (M, 2) px; cells (K, 3); color (K,).
LevelArrays levels_at_blur(const InkLevels& levels, View<const double, 2> xy,
                           View<const std::int32_t, 2> cells, View<const std::int32_t, 1> color,
                           double drawn_sigma, double sigma, const BleedLimits& limits);

}  // namespace cmp::refine
