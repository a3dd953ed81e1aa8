#include "refine/solve/convergence.hpp"

#include <cmath>

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

}  // namespace

Array<double, 3> convergence_covariance(View<const double, 2> shift, View<const double, 2> last, double sigma,
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

}  // namespace cmp::refine
