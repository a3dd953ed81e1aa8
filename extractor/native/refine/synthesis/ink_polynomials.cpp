#include "refine/synthesis/ink_polynomials.hpp"

#include <cmath>
#include <limits>

#include "numeric/dense_systems.hpp"
#include "numeric/median.hpp"

namespace cmp::refine {

namespace {

constexpr double MEDIAN_CHI2 = 0.79;  // median of a chi-square of 3 degrees over 3
constexpr double TINY = 1e-9;         // keeps a division finite

// The scalar product of two vectors of the same length, in eight partial sums that are added at once.
double scalar_product(View<const double, 1> one, View<const double, 1> other) {
  constexpr Index PARTS = 8;
  std::array<double, PARTS> part{};
  const double *const a = one.data(), *const b = other.data();
  const Index count = one.size(), whole = count / PARTS * PARTS;
  for (Index i = 0; i < whole; i += PARTS) {
    for (Index k = 0; k < PARTS; ++k) part[k] += a[i + k] * b[i + k];
  }
  for (Index i = whole; i < count; ++i) part[i - whole] += a[i] * b[i];
  return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
}

// The fit of a polynomial to the levels of an ink's cells.
class PolynomialFit {
 public:
  PolynomialFit(View<const double, 2> terms, View<const double, 2> values)
      : terms_(terms),
        values_(values),
        weighted_({terms.size(1)}),
        residual_({terms.size(1)}),
        gram_({POLYNOMIAL_TERMS, POLYNOMIAL_TERMS}) {}

  // Fills in the weighted least squares polynomial (3, 10) of the first `count` terms, slightly regularised
  // towards 0.
  void fill_polynomial(View<const double, 1> weight, Index count, double ridge, View<double, 2> polynomial) {
    fill_normal_equations(weight, polynomial);
    for (Index channel = 0; channel < 3; ++channel) polynomial[channel].from(count).fill(0.0);
    if (!(gram_(0, 0) > 0.0)) {
      polynomial.fill(0.0);
      return;
    }
    for (Index j = 1; j < count; ++j) gram_(j, j) += ridge * gram_(0, 0);
    numeric::update_to_cholesky_solution(gram_, polynomial, count);
  }

  // Fills in (n,) the mean squared distance of each cell's level from the polynomial (3, 10), gray levels^2.
  void fill_misfits(View<const double, 2> polynomial, View<double, 1> misfit) {
    const auto residual = residual_.view();
    misfit.fill(0.0);
    for (Index channel = 0; channel < 3; ++channel) {
      const auto own = values_[channel];
      std::copy(own.begin(), own.end(), residual.begin());
      for (Index k = 0; k < POLYNOMIAL_TERMS; ++k) {
        const double factor = polynomial(channel, k);
        const auto term = terms_[k];
        for (Index i = 0; i < residual.size(); ++i) residual[i] -= factor * term[i];
      }
      for (Index i = 0; i < residual.size(); ++i) misfit[i] += residual[i] * residual[i] / 3.0;
    }
  }

 private:
  // Fills in the sums over all cells of weight times term times term (lower triangle), and of weight times
  // term times value.
  void fill_normal_equations(View<const double, 1> weight, View<double, 2> right) {
    for (Index j = 0; j < POLYNOMIAL_TERMS; ++j) {
      const auto term = terms_[j];
      for (Index i = 0; i < weight.size(); ++i) weighted_[i] = weight[i] * term[i];
      for (Index k = j; k < POLYNOMIAL_TERMS; ++k) gram_(k, j) = scalar_product(weighted_, terms_[k]);
      for (Index channel = 0; channel < 3; ++channel)
        right(channel, j) = scalar_product(weighted_, values_[channel]);
    }
  }

  View<const double, 2> terms_, values_;
  Array<double, 1> weighted_, residual_;
  Array<double, 2> gram_;
};

double median(View<const double, 1> values) {
  Array<double, 1> copy(values);
  return numeric::median_of_many(copy);
}

}  // namespace

RobustPolynomial robust_polynomial(View<const double, 2> terms, View<const double, 2> values, double noise,
                                   Index count, const PolynomialLimits& limits) {
  const Index n = terms.size(1);
  const auto pixels = values[3];
  Array<double, 1> start({n}), weight({n}), misfit({n}, 0.0);
  for (Index i = 0; i < n; ++i) start[i] = pixels[i] / (1.0 + limits.saturation_per_px * pixels[i]);
  RobustPolynomial out{Array<double, 2>({3, POLYNOMIAL_TERMS}, 0.0), 0.0, Array<bool, 1>({n})};
  for (Index channel = 0; channel < 3; ++channel) out.coefficients(channel, 0) = median(values[channel]);
  PolynomialFit fit(terms, values);
  double variance = std::numeric_limits<double>::infinity();
  for (Index round = 0; round < limits.max_fit_rounds; ++round) {
    fit.fill_misfits(out.coefficients, misfit);
    const double before = variance;
    variance = median(misfit) / MEDIAN_CHI2;
    if (variance > limits.falling_variance * before) break;
    for (Index i = 0; i < n; ++i) {
      const double factor = 1.0 + misfit[i] / (limits.weight_reach * variance + TINY);
      weight[i] = start[i] / (factor * factor);
    }
    fit.fill_polynomial(weight, count, limits.ridge, out.coefficients);
  }
  const double expected = noise * noise / median(pixels);
  const double tolerance = limits.outlier_tolerance * limits.outlier_tolerance;
  for (Index i = 0; i < n; ++i)
    out.is_outlier[i] =
        misfit[i] > tolerance * (variance + noise * noise / pixels[i]) + limits.min_outlier_misfit;
  const auto cells = static_cast<double>(n), free = static_cast<double>(std::max<Index>(n - count, 1));
  out.variance = std::max(variance * cells / free - limits.expected_factor * expected, 0.0);
  return out;
}

}  // namespace cmp::refine
