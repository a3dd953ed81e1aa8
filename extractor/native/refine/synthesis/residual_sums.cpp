#include "refine/synthesis/residual_sums.hpp"

#include "base/processor.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr float FULL_DENSITY =
    2.5066283F;  // the root of 2 pi, by which the normal density is 1 on the gridline

// A sum of every lane by itself, which is added up in the same order on every processor.
class alignas(64) LaneSum {
 public:
  float& operator[](Index lane) { return lanes_[static_cast<std::size_t>(lane)]; }
  double total() {
    add_upper<8>();
    add_upper<4>();
    add_upper<2>();
    return static_cast<double>(lanes_[0] + lanes_[1]);
  }

 private:
  // Adds the second `COUNT` lanes to the first ones.
  template <std::size_t COUNT>
  void add_upper() {
    for (std::size_t i = 0; i < COUNT; ++i) lanes_[i] += lanes_[COUNT + i];
  }

  std::array<float, PIXEL_LANES> lanes_{};
};

// Adds pixels to a gridline's sums; see accumulate_sums.
void accumulate_own_sums(const SideLight& light, const SideLight& bleed, Index count, GridlinePixels& pixels,
                         View<double, 1> sums) {
  const float contrast0 = light.contrast[0], contrast1 = light.contrast[1], contrast2 = light.contrast[2];
  const float step0 = bleed.step[0], step1 = bleed.step[1], step2 = bleed.step[2];
  const float beyond0 = bleed.beyond[0], beyond1 = bleed.beyond[1], beyond2 = bleed.beyond[2];
  const PixelWeights& weights = pixels.weights;
  Residuals& own = pixels.residuals;
  LaneSum aa, ab, bb, a, b, az, bz, blur, curvature, misfit, in_bands;
  for (Index first = 0; first < count; first += PIXEL_LANES) {
#pragma omp simd
    for (Index i = 0; i < PIXEL_LANES; ++i) {
      const Index k = first + i;
      const float h = weights.before_share[k];
      const float r0 = own.residual(0, k), r1 = own.residual(1, k), r2 = own.residual(2, k);
      const float s0 = own.drawn[0][k].slope, s1 = own.drawn[1][k].slope, s2 = own.drawn[2][k].slope;
      const float d0 = contrast0 * s0, d1 = contrast1 * s1, d2 = contrast2 * s2;
      const float b0 = s0 * (beyond0 + h * step0), b1 = s1 * (beyond1 + h * step1),
                  b2 = s2 * (beyond2 + h * step2);
      const float pull = d0 * r0 + d1 * r1 + d2 * r2, information = d0 * d0 + d1 * d1 + d2 * d2;
      const float ga = weights.to_a[k], gb = weights.to_b[k], gz = weights.to_blur[k];
      const float by_a = information * ga, by_b = information * gb;
      // in the middles of cells the levels follow the image: bleed counts beside the gridline
      const float beside = FULL_DENSITY * (ga + gb);
      const float cross = beside * (b0 * d0 + b1 * d1 + b2 * d2);
      const float blur_cross = information * gz + cross;
      const float in_band = weights.in_band[k];
      own.projection[k] = pull;
      own.information[k] = information;
      pixels.blur_cross[k] = blur_cross;
      aa[i] += by_a * ga;
      ab[i] += by_a * gb;
      bb[i] += by_b * gb;
      a[i] += ga * pull;
      b[i] += gb * pull;
      az[i] += ga * blur_cross;
      bz[i] += gb * blur_cross;
      blur[i] += gz * pull + beside * (b0 * r0 + b1 * r1 + b2 * r2);
      curvature[i] += gz * (blur_cross + cross) + beside * beside * (b0 * b0 + b1 * b1 + b2 * b2);
      misfit[i] += in_band * (r0 * r0 + r1 * r1 + r2 * r2);
      in_bands[i] += in_band;
    }
  }
  sums[AA] += aa.total();
  sums[AB] += ab.total();
  sums[BB] += bb.total();
  sums[A] += a.total();
  sums[B] += b.total();
  sums[A_BLUR] += az.total();
  sums[B_BLUR] += bz.total();
  sums[BLUR] += blur.total();
  sums[BLUR_CURVATURE] += curvature.total();
  sums[MISFIT] += misfit.total();
  sums[PIXELS] += in_bands.total();
}

// Adds pixels to the sums of a gridline that bends; see accumulate_bending_sums.
void accumulate_sums_of_bending(const GridlinePixels& pixels, Index count, View<double, 1> sums) {
  const PixelWeights& weights = pixels.weights;
  LaneSum ac, ad, bc, bd, cc, cd, dd, c, d, cz, dz;
  for (Index first = 0; first < count; first += PIXEL_LANES) {
#pragma omp simd
    for (Index i = 0; i < PIXEL_LANES; ++i) {
      const Index k = first + i;
      const float ga = weights.to_a[k], gb = weights.to_b[k], gc = weights.to_c[k], gd = weights.to_d[k];
      const float own = pixels.residuals.information[k], pull = pixels.residuals.projection[k];
      const float by_c = own * gc, by_d = own * gd, blur_cross = pixels.blur_cross[k];
      ac[i] += ga * by_c;
      ad[i] += ga * by_d;
      bc[i] += gb * by_c;
      bd[i] += gb * by_d;
      cc[i] += gc * by_c;
      cd[i] += gc * by_d;
      dd[i] += gd * by_d;
      c[i] += gc * pull;
      d[i] += gd * pull;
      cz[i] += gc * blur_cross;
      dz[i] += gd * blur_cross;
    }
  }
  sums[AC] += ac.total();
  sums[AD] += ad.total();
  sums[BC] += bc.total();
  sums[BD] += bd.total();
  sums[CC] += cc.total();
  sums[CD] += cd.total();
  sums[DD] += dd.total();
  sums[C] += c.total();
  sums[D] += d.total();
  sums[C_BLUR] += cz.total();
  sums[D_BLUR] += dz.total();
}

}  // namespace

void accumulate_sums(const SideLight& light, const SideLight& bleed, Index count, GridlinePixels& pixels,
                     View<double, 1> sums) {
  run_loop<accumulate_own_sums>(light, bleed, count, pixels, sums);
}

void accumulate_bending_sums(const GridlinePixels& pixels, Index count, View<double, 1> sums) {
  run_loop<accumulate_sums_of_bending>(pixels, count, sums);
}

}  // namespace cmp::refine
