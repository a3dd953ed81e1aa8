// The disagreement of the gridlines that meet at markers, and the variance that it shows.
//
// A marker has two unknowns and up to six gridlines. Where noise alone moves gridlines, the squared distances
// between each gridline's own place and its place by the solved markers add up to the degrees of freedom.
// Halos, clipping, displaced ink edges, dirt and compression increase these distances. The ratio multiplies
// the variance of the noise (the Birge ratio; Birge, Phys. Rev. 40, 207, 1932). It is estimated at three
// levels, each of which counts as some more degrees of freedom at the next one: the picture; the gridlines
// inside, and those that end at the rim, which have other neighbours than cells; the gridlines around each
// gridline.
#pragma once

#include "base/array.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/solve/fisher_information.hpp"

namespace cmp::refine {

// Limits of the variance that the disagreement shows.
struct DisagreementLimits {
  // degrees of freedom of the t distribution by which gridlines count for their picture. Chosen; `python -m
  // benchmarks.calibration` judges it.
  double tail_freedom = 6.0;
  // degrees of freedom by which the ratio of one level counts beside that of the next one. Chosen; `python -m
  // benchmarks.calibration` judges it.
  double picture_freedom = 20.0;
  Index rounds = 4;  // of the picture's ratio. Chosen.
  // degrees of freedom of a gridline, at least. Derived: it only keeps a division from failing.
  double min_freedom = 0.1;
  // of a distance over its deviation, at most. Derived: it only keeps a division from failing.
  double max_square = 1000000.0;
  double min_ratio = 0.001;  // of variances, at least. Derived: it only keeps a division from failing.
  // of a gridline's two ends, relative to the product of their sums; with less the two ends are not told
  // apart, and the gridline does not count. Chosen.
  double min_determinant = 1e-6;
  // of a marker's block, relative to its squared trace; with less, all gridlines at the marker run in one
  // direction. Derived: far above rounding.
  double min_block_determinant = 1e-9;
};

// (E,) the ratio of the variance along each gridline to that of noise, by the disagreement of the gridlines
// around.
//
// system and gradients, bending eliminated from both; shift (M, 2) px, the solution.
Array<double, 1> variance_ratios(const GridlineSystem& system, const ShiftGradients& gradients,
                                 View<const double, 2> shift, const DisagreementLimits& limits);

}  // namespace cmp::refine
