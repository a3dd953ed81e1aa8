// The weights of the pixels near a gridline: close to the derivatives of the drawing by the offsets of its
// two ends.
#pragma once

#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

// The normal density as a polynomial of fifth degree in z^2, good to 2e-5 up to z = 2.6: least squares over
// 200 values of z, evenly spaced from 0 to 2.6.
inline constexpr float C0 = 3.9887282e-01F, C1 = -1.986254e-01F, C2 = 4.820418e-02F;
inline constexpr float C3 = -7.0862724e-03F, C4 = 6.068872e-04F, C5 = -2.2943324e-05F;
// Its integral.
inline constexpr float I1 = -6.620847e-02F, I2 = 9.640836e-03F, I3 = -1.0123246e-03F;
inline constexpr float I4 = 6.7431916e-05F, I5 = -2.0857567e-06F;

// The share of the light before a gridline, at the distance z beyond the gridline in units of the blur; good
// within the range of the polynomial.
inline float half_share(float z) {
  const float zz = z * z;
  return 0.5F - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))));
}

// The weights of pixels: the derivatives of the drawing by the offsets of a gridline's two ends, by the blur,
// and by the bending with the weights t (1 - t) and t (1 - t) (1 - 2 t).
struct alignas(64) PixelWeights {
  PixelColumn in_band;  // 1 for pixels that count, else 0
  PixelColumn to_a, to_b, to_blur, to_c, to_d;
  PixelColumn before_share;  // the share of the light before the gridline
};

// The pixels of some rows of one gridline.
struct GridlinePixels {
  BlockRows rows;
  PixelWeights weights;
  Residuals residuals;
  PixelColumn blur_cross;  // the products of the derivatives by the share of the light and by the blur
  PixelColumn station;     // the number of the station that a pixel belongs to
};

// How far the weights of a gridline reach.
struct WeightReach {
  float reach;      // px, beyond the gridline's ends
  float end_width;  // the width of the blurred ends, in units of the chord
};

inline WeightReach weight_reach(double reach, double sigma, double length) {
  constexpr double END_BELL = 0.3989;  // the density at the middle of a blurred end
  return {static_cast<float>(reach), static_cast<float>(END_BELL * sigma / length)};
}

// Fills in the weights of all pixels of the rows across a gridline, 0 beyond the reach.
//
// The weights are polynomials close to the derivative of the drawing: the normal density of the distance, and
// the blurred ends of 1 - t and t. Any weights give an unbiased gradient. Loops without branches and tables
// are fast.
void fill_weights(const RowBlock& block, const PixelGeometry& line, const WeightReach& reach,
                  GridlinePixels& pixels);

}  // namespace cmp::refine
