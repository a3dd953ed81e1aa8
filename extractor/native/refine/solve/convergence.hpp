// The remaining error after the last step by synthesis.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::refine {

// Limits of that error; explained in extractor/refine/solve/convergence.py.
struct ConvergenceLimits {
  double remaining_share, max_remaining_share, max_shrinking, mean_over_median;

  template <class F>
  static ConvergenceLimits read(const F& f) {
    return {f["remaining_share"], f["max_remaining_share"], f["max_shrinking"], f["mean_over_median"]};
  }
};

// shift, cov_px2 and error of StepRemainder.
using StepRemainder = std::tuple<Array<double, 2>, Array<double, 3>, double>;

// The error that the last step left.
//
// The drawing responds less than linearly to shifts of the size of the blur. A marker whose steps
// shrink slowly is as far from its place as the steps that would follow. measured and drawn (M, 2) px, the
// markers after the step and before; last (M, 2) px, the step before, or NaN; sigma, the blur, px;
// remaining_share, the share of a usual step that is left in any case; diagonal (M, 3) 1/px^2, the blocks of
// the information.
StepRemainder step_remainder(View<const double, 2> measured, View<const double, 2> drawn,
                             View<const double, 2> last, double sigma, double remaining_share,
                             View<const double, 2> diagonal, const ConvergenceLimits& limits);

// The RMS bending (E, 2) px of the gridlines that are read, in deviations of a typical marker; infinite where
// none is read. is_read (E,), diagonal (M, 3) 1/px^2.
double typical_bending(View<const double, 2> bend, View<const bool, 1> is_read,
                       View<const double, 2> diagonal);

}  // namespace cmp::refine
