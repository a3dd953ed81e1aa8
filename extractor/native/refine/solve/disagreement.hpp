// The disagreement of the gridlines that meet at markers, and the variance that it shows.
//
// A marker has two unknowns and up to six gridlines. Where noise alone moves gridlines, the squared distances
// between each gridline's own place and the place that the solved markers give it add up to the degrees of
// freedom. The ratio, of the picture and of the gridlines around each, multiplies the variance of the noise
// (the Birge ratio; Birge, Phys. Rev. 40, 207, 1932).
#pragma once

#include "base/array.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/solve/fisher_information.hpp"

namespace cmp::refine {

// Limits of the variance; explained in extractor/refine/solve/disagreement.py.
struct DisagreementLimits {
  double tail_freedom, picture_freedom;
  Index rounds;
  double min_freedom, max_square, min_ratio, min_determinant, min_block_determinant;

  template <class F>
  static DisagreementLimits read(const F& f) {
    return {f["tail_freedom"], f["picture_freedom"], f["rounds"],          f["min_freedom"],
            f["max_square"],   f["min_ratio"],       f["min_determinant"], f["min_block_determinant"]};
  }
};

// (E,) the ratio of the variance along each gridline to that of noise, by the disagreement of the gridlines
// around.
//
// system and gradients, bending eliminated from both; shift (M, 2) px, the solution.
Array<double, 1> variance_ratios(const GridlineSystem& system, const ShiftGradients& gradients,
                                 View<const double, 2> shift, const DisagreementLimits& limits);

}  // namespace cmp::refine
