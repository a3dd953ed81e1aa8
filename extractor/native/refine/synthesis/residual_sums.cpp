#include "refine/synthesis/residual_sums.hpp"

#include "base/processor.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr float FULL_DENSITY =
    2.5066283F;  // the root of 2 pi, by which the normal density is 1 on the gridline

// Fills in the columns of the residuals; see fill_projections.
void fill_residual_columns(const SideLight& light, const SideLight& bleed, Index count,
                           GridlinePixels& pixels) {
  const float contrast0 = light.contrast[0], contrast1 = light.contrast[1], contrast2 = light.contrast[2];
  const float step0 = bleed.step[0], step1 = bleed.step[1], step2 = bleed.step[2];
  const float beyond0 = bleed.beyond[0], beyond1 = bleed.beyond[1], beyond2 = bleed.beyond[2];
  Residuals& own = pixels.residuals;
#pragma omp simd
  for (Index k = 0; k < count; ++k) {
    const float h = pixels.weights.before_share[k];
    const float r0 = own.residual(0, k), r1 = own.residual(1, k), r2 = own.residual(2, k);
    const float s0 = own.drawn[0][k].slope, s1 = own.drawn[1][k].slope, s2 = own.drawn[2][k].slope;
    const float d0 = contrast0 * s0, d1 = contrast1 * s1, d2 = contrast2 * s2;
    const float b0 = s0 * (beyond0 + h * step0), b1 = s1 * (beyond1 + h * step1),
                b2 = s2 * (beyond2 + h * step2);
    own.projection[k] = d0 * r0 + d1 * r1 + d2 * r2;
    own.information[k] = d0 * d0 + d1 * d1 + d2 * d2;
    pixels.square[k] = r0 * r0 + r1 * r1 + r2 * r2;
    pixels.bleed_projection[k] = b0 * r0 + b1 * r1 + b2 * r2;
    pixels.bleed_cross[k] = b0 * d0 + b1 * d1 + b2 * d2;
    pixels.bleed_square[k] = b0 * b0 + b1 * b1 + b2 * b2;
  }
}

}  // namespace

void fill_projections(const SideLight& light, const SideLight& bleed, Index count, GridlinePixels& pixels) {
  run_loop<fill_residual_columns>(light, bleed, count, pixels);
}

void accumulate_sums(const GridlinePixels& pixels, Index count, View<double, 1> sums) {
  const PixelWeights& weights = pixels.weights;
  float blur = 0.0F, curvature = 0.0F, misfit = 0.0F, in_bands = 0.0F, az = 0.0F, bz = 0.0F;
  // in float64 the order of summing hardly changes the sums that move the markers
  double aa = 0.0, ab = 0.0, bb = 0.0, sa = 0.0, sb = 0.0;
  for (Index k = 0; k < count; ++k) {
    const float ga = weights.to_a[k], gb = weights.to_b[k], gz = weights.to_blur[k];
    const float own = pixels.residuals.information[k], pull = pixels.residuals.projection[k];
    const float by_a = own * ga, by_b = own * gb;
    aa += static_cast<double>(by_a * ga);
    ab += static_cast<double>(by_a * gb);
    bb += static_cast<double>(by_b * gb);
    sa += static_cast<double>(ga * pull);
    sb += static_cast<double>(gb * pull);
    // in the middles of cells the levels follow the image: bleed counts beside the gridline
    const float beside = FULL_DENSITY * (ga + gb);
    const float cross = beside * pixels.bleed_cross[k];
    const float blur_cross = own * gz + cross;
    az += ga * blur_cross;
    bz += gb * blur_cross;
    const float in_band = weights.in_band[k];
    blur += gz * pull + beside * pixels.bleed_projection[k];
    curvature += gz * (blur_cross + cross) + beside * beside * pixels.bleed_square[k];
    misfit += in_band * pixels.square[k];
    in_bands += in_band;
  }
  sums[AA] += aa;
  sums[AB] += ab;
  sums[BB] += bb;
  sums[A] += sa;
  sums[B] += sb;
  sums[BLUR] += static_cast<double>(blur);
  sums[BLUR_CURVATURE] += static_cast<double>(curvature);
  sums[A_BLUR] += static_cast<double>(az);
  sums[B_BLUR] += static_cast<double>(bz);
  sums[MISFIT] += static_cast<double>(misfit);
  sums[PIXELS] += static_cast<double>(in_bands);
}

void accumulate_bending_sums(const GridlinePixels& pixels, Index count, View<double, 1> sums) {
  const PixelWeights& weights = pixels.weights;
  float ac = 0.0F, ad = 0.0F, bc = 0.0F, bd = 0.0F, cc = 0.0F, cd = 0.0F, dd = 0.0F;
  float sc = 0.0F, sd = 0.0F, cz = 0.0F, dz = 0.0F;
  for (Index k = 0; k < count; ++k) {
    const float ga = weights.to_a[k], gb = weights.to_b[k], gc = weights.to_c[k], gd = weights.to_d[k];
    const float own = pixels.residuals.information[k], pull = pixels.residuals.projection[k];
    const float by_c = own * gc, by_d = own * gd;
    const float blur_cross = own * weights.to_blur[k] + FULL_DENSITY * (ga + gb) * pixels.bleed_cross[k];
    ac += ga * by_c;
    ad += ga * by_d;
    bc += gb * by_c;
    bd += gb * by_d;
    cc += gc * by_c;
    cd += gc * by_d;
    dd += gd * by_d;
    sc += gc * pull;
    sd += gd * pull;
    cz += gc * blur_cross;
    dz += gd * blur_cross;
  }
  constexpr std::array<Index, 11> COLUMNS{AC, AD, BC, BD, CC, CD, DD, C, D, C_BLUR, D_BLUR};
  const std::array<float, 11> own{ac, ad, bc, bd, cc, cd, dd, sc, sd, cz, dz};
  for (std::size_t k = 0; k < own.size(); ++k) sums[COLUMNS[k]] += static_cast<double>(own[k]);
}

}  // namespace cmp::refine
