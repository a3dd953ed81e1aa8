// The remaining error after the last step by synthesis.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::refine {

// Limits of the remaining error after the last step.
struct ConvergenceLimits {
  double remaining_share = 1.0;      // of a step, per blur, that another step would still correct. Chosen.
  double max_remaining_share = 0.5;  // of a step, at most. Chosen.
  // of a marker's last step over the step before, at most; the following steps would shrink by the same
  // factor. Chosen: the following steps together are at most as long as the last one, because a factor from
  // two steps is uncertain.
  double max_shrinking = 0.5;
  // of squares, by which the median of the squared shifts becomes their mean. Derived: 1 / ln 2, of the sum
  // of two normal squares.
  double mean_over_median = 1.44;
};

struct StepRemainder {
  Array<double, 2> shift;    // (M, 2) px
  Array<double, 3> cov_px2;  // (M, 2, 2)
  double error;              // standard deviations of one axis

  CMP_RECORD("extractor.refine.solve.convergence.StepRemainder", shift, cov_px2, error)
};

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
