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

// Limits of a robust fit.
struct PolynomialLimits {
  double outlier_tolerance = 4.0;   // deviations of the scatter, beyond which a cell is an outlier. Chosen.
  double min_outlier_misfit = 4.0;  // gray levels^2, added to that tolerance. Chosen.
  Index max_fit_rounds = 10;        // rounds of weighting. Chosen.
  double falling_variance = 0.9;    // rounds end when the scatter falls to no less than this share. Chosen.
  // 1/px; a cell of n pixels weighs n / (1 + saturation_per_px n) before the first round. Chosen.
  double saturation_per_px = 0.1;
  // in units of the scatter, the misfit where a cell's weight is a quarter. Chosen.
  double weight_reach = 6.0;
  // of the variance expected from noise, the part that is no scatter of the cells. Chosen.
  double expected_factor = 1.15;
  // added to the diagonal of the normal equations, in units of the cells' total weight. Chosen.
  double ridge = 1e-6;
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
