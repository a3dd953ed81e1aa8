#include "refine/synthesis/pixel_weights.hpp"

#include "base/processor.hpp"

namespace cmp::refine {

namespace {

// The normal distribution as a quintic from -1 to 1; 1 / END units of the blur reach to 1. Its derivative is
// P1 (1 - z^2)^2.
constexpr float P1 = 15.0F / 16.0F, P3 = -5.0F / 8.0F, P5 = 3.0F / 16.0F;
constexpr float END = 0.42F;

// At a pixel.
struct WeightParts {
  float z;           // the distance from the gridline in units of the blur
  float density;     // the normal density there
  float to_a, to_b;  // the derivatives of the gridline's offset there by the offsets of its start and end
};

// along and across are the pixel's place, px.
inline WeightParts weight_parts(float along, float across, const PixelGeometry& line, float end_width) {
  const float length = line.length, leave = line.leave, arrive = line.arrive, inverse = line.inverse_sigma;
  const float t = along * line.inverse_length;
  const float inside = std::min(std::max(t, 0.0F), 1.0F);
  float off = inside * (1.0F - inside) * (leave * (1.0F - inside) - arrive * inside);
  off += leave * std::min(t, 0.0F) + arrive * std::max(t - 1.0F, 0.0F);
  const float z = (across - length * off) * inverse;
  const float zz = z * z;
  const float g = std::max(C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))), 0.0F);
  const float at_start = along * (inverse * END);
  const float start = std::min(std::max(at_start, -1.0F), 1.0F);
  const float end = std::min(std::max(at_start - (length * inverse) * END, -1.0F), 1.0F);
  const float ss = start * start, ee = end * end;
  const float bell_s = (1.0F - ss) * (1.0F - ss), bell_e = (1.0F - ee) * (1.0F - ee);
  const float rise = 0.5F + start * (P1 + ss * (P3 + ss * P5));
  const float fall = 0.5F + end * (P1 + ee * (P3 + ee * P5));
  const float inner = rise - fall;
  const float to_b = t * inner + end_width * (bell_s - bell_e);
  return {z, g, inner - to_b, to_b};
}

// Fills in the columns of the weights; see fill_weights.
void fill_columns(const RowBlock& block, const PixelGeometry& geometry, const WeightReach& weight_reach,
                  GridlinePixels& pixels) {
  const BlockRows& rows = pixels.rows;
  PixelWeights& out = pixels.weights;
  const PixelGeometry line = geometry;
  const float reach = weight_reach.reach, end_width = weight_reach.end_width;
  const Index lanes = block.lanes();
  for (Index first = 0; first < lanes; first += PIXEL_LANES) {
    for (Index j = 0; j < block.row_length; ++j) {
      const auto step = static_cast<float>(j);
#pragma omp simd
      for (Index i = first; i < first + PIXEL_LANES; ++i) {
        const Index at = j * lanes + i;
        const float along = rows.along[i] + step * line.along_step;
        const float across = rows.across[i] + step * line.across_step;
        const bool within = (step >= rows.from[i]) & (step <= rows.to[i]);
        const float keep = (within & (along >= -reach) & (along <= line.length + reach)) ? 1.0F : 0.0F;
        const WeightParts parts = weight_parts(along, across, line, end_width);
        const float ga = keep * parts.density * parts.to_a, gb = keep * parts.density * parts.to_b;
        const float gc = ga * parts.to_b;
        out.in_band[at] = keep;
        out.to_a[at] = ga;
        out.to_b[at] = gb;
        out.to_blur[at] = parts.z * (ga + gb);
        out.to_c[at] = gc;
        out.to_d[at] = gc * (parts.to_a - parts.to_b);
        out.before_share[at] = half_share(parts.z);
      }
    }
  }
}

}  // namespace

void fill_weights(const RowBlock& block, const PixelGeometry& line, const WeightReach& reach,
                  GridlinePixels& pixels) {
  run_loop<fill_columns>(block, line, reach, pixels);
}

}  // namespace cmp::refine
