// The remaining error after the last step by synthesis.
#pragma once

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

// (M, 2, 2) px^2, the covariance of the error that the last step left.
//
// The drawing responds less than linearly to shifts of the size of the blur. A marker whose steps
// shrink slowly is as far from its place as the steps that would follow. shift (M, 2) px, the last step; last
// (M, 2) px, the one before, or NaN; sigma, the blur, px; remaining_share, the share of a usual step that is
// left in any case.
Array<double, 3> convergence_covariance(View<const double, 2> shift, View<const double, 2> last, double sigma,
                                        double remaining_share, const ConvergenceLimits& limits);

}  // namespace cmp::refine
