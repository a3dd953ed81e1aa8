#include "refine/solve/convergence.hpp"

#include <cmath>
#include <limits>

#include "numeric/median.hpp"

namespace cmp::refine {

namespace {

// The median of the numbers that are not NaN; NaN without any.
double median_of_known(View<const double, 1> values) {
  Array<double, 1> known({values.size()});
  double* const end =
      std::copy_if(values.begin(), values.end(), known.begin(), [](double v) { return !std::isnan(v); });
  return numeric::median_of_many(known.slice(0, end - known.begin()));
}

// The sum of the steps that would follow a step (x, y) after another one, in units of this step, if they
// shrink by the same factor.
double following_steps(double x, double y, double last_x, double last_y, double max_shrinking) {
  const double factor = (x * last_x + y * last_y) / (last_x * last_x + last_y * last_y);
  if (!(factor > 0.0)) return 0.0;
  const double shrinking = std::min(factor, max_shrinking);
  return shrinking / (1.0 - shrinking);
}

// The covariances (M, 2, 2) px^2 of the error after a step of shifts (M, 2) px.
Array<double, 3> remaining_covariance(View<const double, 2> shift, View<const double, 2> last, double sigma,
                                      double remaining_share, const ConvergenceLimits& limits) {
  const Index count = shift.size();
  Array<double, 3> out({count, 2, 2}, 0.0);
  Array<double, 1> square({count});
  const auto cov = out.view();
  for (Index m = 0; m < count; ++m) {
    const double x = shift(m, 0), y = shift(m, 1);
    square[m] = x * x + y * y;
    const double by_blur =
        std::min(limits.remaining_share * std::sqrt(square[m]) / sigma, limits.max_remaining_share);
    const double share =
        std::hypot(by_blur, following_steps(x, y, last(m, 0), last(m, 1), limits.max_shrinking));
    cov(m, 0, 0) = (share * x) * (share * x);
    cov(m, 1, 1) = (share * y) * (share * y);
    cov(m, 0, 1) = cov(m, 1, 0) = share * share * x * y;
  }
  if (remaining_share > 0.0) {
    const double share = std::min(remaining_share, 1.0);
    const double variance = 0.5 * (share * share) * limits.mean_over_median * median_of_known(square);
    for (Index m = 0; m < count; ++m) {
      cov(m, 0, 0) += variance;
      cov(m, 1, 1) += variance;
    }
  }
  return out;
}

// The error of all known markers, RMS, in standard deviations of one axis; 0 where none is known.
double typical_error(View<const double, 3> cov, View<const double, 2> diagonal) {
  double total = 0.0;
  Index count = 0;
  for (Index m = 0; m < cov.size(); ++m) {
    const double square =
        diagonal(m, 0) * cov(m, 0, 0) + 2 * diagonal(m, 1) * cov(m, 0, 1) + diagonal(m, 2) * cov(m, 1, 1);
    if (!std::isfinite(square)) continue;
    total += square;
    ++count;
  }
  return count > 0 ? std::sqrt(0.5 * total / static_cast<double>(count)) : 0.0;
}

// The deviation of one axis, px, that the information allows a typical marker; NaN without any.
double typical_deviation(View<const double, 2> diagonal) {
  Array<double, 1> traces({diagonal.size()});
  for (Index m = 0; m < diagonal.size(); ++m) traces[m] = diagonal(m, 0) + diagonal(m, 2);
  return std::sqrt(2.0 / numeric::median_of_many(traces));
}

}  // namespace

StepRemainder step_remainder(View<const double, 2> measured, View<const double, 2> drawn,
                             View<const double, 2> last, double sigma, double remaining_share,
                             View<const double, 2> diagonal, const ConvergenceLimits& limits) {
  Array<double, 2> shift({measured.size(), 2});
  for (Index m = 0; m < measured.size(); ++m) {
    for (Index axis = 0; axis < 2; ++axis) shift(m, axis) = measured(m, axis) - drawn(m, axis);
  }
  Array<double, 3> cov = remaining_covariance(shift, last, sigma, remaining_share, limits);
  const double error = typical_error(cov, diagonal);
  return {std::move(shift), std::move(cov), error};
}

double typical_bending(View<const double, 2> bend, View<const bool, 1> is_read,
                       View<const double, 2> diagonal) {
  double total = 0.0;
  Index count = 0;
  for (Index e = 0; e < is_read.size(); ++e) {
    if (!is_read[e]) continue;
    total += bend(e, 0) * bend(e, 0) + bend(e, 1) * bend(e, 1);
    count += 2;
  }
  if (count == 0) return std::numeric_limits<double>::infinity();
  return std::sqrt(total / static_cast<double>(count)) / typical_deviation(diagonal);
}

}  // namespace cmp::refine
