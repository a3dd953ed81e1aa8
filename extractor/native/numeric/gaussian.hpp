// The normal distribution, and the coverage of a pixel by a blurred half plane or wedge.
//
// Lengths are in units of the blur. For a pixel at the distance h inside one side of a wedge and k inside the
// other, the coverage is the probability that two normal deviates of correlation r lie below h and k. r is
// the cosine between the directions of the sides, both along the wedge's outline. At right angles the
// coverage is N(h) N(k); its derivative with respect to r is the bivariate density (Drezner and Wesolowsky
// 1990):
//
//   share = N(h) N(k) + integral from 0 to r of exp(-(h^2 + k^2 - 2 h k s) / 2 (1 - s^2)) / 2 pi sqrt(1 -
//   s^2) ds.
//
// With s = 2 u / (1 + u^2) the integrand is smooth enough for a Gauss-Legendre rule of three nodes.
#pragma once

#include <cmath>
#include <numbers>

#include "base/array.hpp"

namespace cmp::numeric {

inline constexpr double NORMAL_REACH = 3.3;  // in units of the blur; a side farther away has no influence
inline constexpr int GAUSS_COUNT = 3;        // error 6e-5 for wedges of 30 to 150 degrees, 3e-4 for 20 to 160
inline constexpr double GAUSS_NODES[GAUSS_COUNT] = {-0.7745966692414834, 0.0, 0.7745966692414834};
inline constexpr double GAUSS_WEIGHTS[GAUSS_COUNT] = {0.5555555555555557, 0.8888888888888888,
                                                      0.5555555555555557};
inline constexpr int CORNER_TERMS =
    9;                                // of a corner: three factors of h^2 + k^2, three of h k, three weights
inline constexpr int EXP_POWER = 16;  // the exponential is this power of a cubic
inline constexpr float EXP_END = 12.0F / EXP_POWER;  // exp(-12) counts as 0

// The polynomial in z^2 for (N(z) - 0.5) / z, with an error of 3e-6 up to NORMAL_REACH: least squares over
// z = NORMAL_REACH sin(t), t evenly spaced.
inline constexpr float N0 = 0.39892966F, N1 = -0.06643246F, N2 = 0.009894961F, N3 = -0.0011384949F;
inline constexpr float N4 = 9.8826655e-05F, N5 = -6.059199e-06F, N6 = 2.2961594e-07F, N7 = -3.970251e-9F;
// The cubic for exp(-x) up to EXP_END, whose power has an error of 1e-5: least squares, weighted by exp(-15
// x), because the power multiplies an error by the other factors.
inline constexpr float E0 = 0.9999989F, E1 = -0.9998702F, E2 = 0.49702352F, E3 = -0.146213F;

using CornerTerms = std::array<float, CORNER_TERMS>;

// The normal distribution of z, |z| <= NORMAL_REACH.
inline float normal_cdf(float z) {
  const float zz = z * z;
  return 0.5F + z * (N0 + zz * (N1 + zz * (N2 + zz * (N3 + zz * (N4 + zz * (N5 + zz * (N6 + zz * N7)))))));
}

// Writes the terms (CORNER_TERMS,) of a corner for wedge_correlation; r is the cosine between its sides'
// directions.
inline void fill_corner_terms(double r, View<float, 1> out) {
  const double end = r / (1.0 + std::sqrt(std::max(1.0 - r * r, 0.0)));
  for (int i = 0; i < GAUSS_COUNT; ++i) {
    const double u = 0.5 * end * (1.0 + GAUSS_NODES[i]);
    const double more = 1.0 + u * u, less = 1.0 - u * u;
    const double steep = more / (less * less * EXP_POWER);
    out[i] = static_cast<float>(0.5 * more * steep);
    out[3 + i] = static_cast<float>(2.0 * u * steep);
    out[6 + i] = static_cast<float>(GAUSS_WEIGHTS[i] * end / (2.0 * std::numbers::pi * more));
  }
}

// exp(-16 x), x >= 0.
inline float exp_minus_16x(float x) {
  x = x < EXP_END ? x : EXP_END;
  float e = E0 + x * (E1 + x * (E2 + x * E3));
  e = e * e;
  e = e * e;
  e = e * e;
  return e * e;
}

// The coverage by a wedge minus the product N(h) N(k) of its sides.
//
// squares: h^2 + k^2; product: h k; corner: the terms of fill_corner_terms.
inline float wedge_correlation(float squares, float product, const CornerTerms& corner) {
  float coverage = corner[6] * exp_minus_16x(corner[0] * squares - corner[3] * product);
  coverage += corner[7] * exp_minus_16x(corner[1] * squares - corner[4] * product);
  return coverage + corner[8] * exp_minus_16x(corner[2] * squares - corner[5] * product);
}

}  // namespace cmp::numeric
