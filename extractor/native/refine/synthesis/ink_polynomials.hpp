// Polynomials of third degree over an image, fitted robustly to the levels of one ink's cells.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

inline constexpr Index POLYNOMIAL_TERMS = 10;  // 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy

using Monomials = std::array<double, POLYNOMIAL_TERMS>;

// The ten terms at (x, y).
inline Monomials monomials(double x, double y) {
  return {1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y};
}

// Limits of a robust fit; explained in extractor/refine/synthesis/ink_polynomials.py.
struct PolynomialLimits {
  double outlier_tolerance, min_outlier_misfit;
  Index max_fit_rounds;
  double falling_variance, saturation_per_px, weight_reach, expected_factor, ridge;

  template <class F>
  static PolynomialLimits read(const F& f) {
    return {f["outlier_tolerance"], f["min_outlier_misfit"], f["max_fit_rounds"],  f["falling_variance"],
            f["saturation_per_px"], f["weight_reach"],       f["expected_factor"], f["ridge"]};
  }
};

// A robust polynomial of one ink.
struct RobustPolynomial {
  Array<double, 2> coefficients;  // (3, 10) by channel
  double variance;                // gray levels^2, of the cells about it beyond noise
  Array<bool, 1> is_outlier;      // (n,)
};

// The rounds of weighting begin at the medians of the channels, which many outliers on one side do not move.
//
// terms (10, n); values (4, n) gray levels in three channels, and the number of pixels; noise, gray levels;
// count of terms to fit.
RobustPolynomial robust_polynomial(View<const double, 2> terms, View<const double, 2> values, double noise,
                                   Index count, const PolynomialLimits& limits);

}  // namespace cmp::refine
