#include "refine/measure/station_pixels.hpp"

#include <cmath>

#include "base/processor.hpp"
#include "refine/synthesis/pixel_weights.hpp"

namespace cmp::refine {

namespace {

// Fills in the columns of the pixels; see fill_stations.
void fill_station_columns(const BlockRows& rows, const RowBlock& block, const PixelGeometry& geometry,
                          float intervals, float band, StationPixels& pixels) {
  const PixelGeometry line = geometry;
  const Index lanes = block.lanes();
  const float square = band * band;
  for (Index first = 0; first < lanes; first += PIXEL_LANES) {
    for (Index j = 0; j < block.row_length; ++j) {
      const auto step = static_cast<float>(j);
#pragma omp simd
      for (Index i = first; i < first + PIXEL_LANES; ++i) {
        const Index at = j * lanes + i;
        const float t = (rows.along[i] + step * line.along_step) * line.inverse_length;
        const float s = 1.0F - t;
        const float bow = line.length * (t * s * (line.leave * s - line.arrive * t));
        const float z = (rows.across[i] + step * line.across_step - bow) * line.inverse_sigma;
        const float zz = z * z;
        const bool is_within = (step <= rows.to[i]) & (zz < square);
        const float g = C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5))));
        const float share = half_share(z);  // the polynomial holds within the band
        pixels.station[at] = std::floor(t * intervals - 0.5F);
        pixels.weight[at] = is_within ? g : 0.0F;
        pixels.before_share[at] = is_within ? share : 0.0F;
      }
    }
  }
}

}  // namespace

void fill_stations(const BlockRows& rows, const RowBlock& block, const PixelGeometry& line, float intervals,
                   float band, StationPixels& pixels) {
  run_loop<fill_station_columns>(rows, block, line, intervals, band, pixels);
}

StationSums sums_at_station(const StationPixels& pixels, const Residuals& residuals, Index count,
                            float station) {
  float residual = 0.0F, information = 0.0F;
  for (Index k = 0; k < count; ++k) {
    const float own = pixels.weight[k];
    const float g = pixels.station[k] == station ? own : 0.0F;
    residual += g * residuals.projection[k];
    information += g * g * residuals.information[k];
  }
  return {residual, information};
}

}  // namespace cmp::refine
