#include "refine/synthesis/station_sums.hpp"

#include <cmath>

#include "base/processor.hpp"

namespace cmp::refine {

namespace {

// Fills in the station that each pixel belongs to, and weighs what the pixel tells.
void fill_station_columns(const RowBlock& block, const PixelGeometry& geometry, float intervals,
                          GridlinePixels& pixels) {
  const PixelGeometry line = geometry;
  const Index lanes = block.lanes();
  for (Index first = 0; first < lanes; first += PIXEL_LANES) {
    for (Index j = 0; j < block.row_length; ++j) {
      const auto step = static_cast<float>(j);
#pragma omp simd
      for (Index i = first; i < first + PIXEL_LANES; ++i) {
        const float t = (pixels.rows.along[i] + step * line.along_step) * line.inverse_length;
        const Index at = j * lanes + i;
        const float weight = pixels.weights.to_a[at] + pixels.weights.to_b[at];
        pixels.station[at] = std::floor(t * intervals - 0.5F);
        pixels.residuals.projection[at] *= weight;
        pixels.residuals.information[at] *= weight * weight;
      }
    }
  }
}

}  // namespace

void accumulate_station_sums(const RowBlock& block, const PixelGeometry& line, GridlinePixels& pixels,
                             View<double, 2> sums) {
  if (sums.size() == 0) return;
  const auto intervals = static_cast<float>(sums.size() + 1);
  run_loop<fill_station_columns>(block, line, intervals, pixels);
  const Index count = block.pixels();
  for (Index j = 0; j < sums.size(); ++j) {
    const auto station = static_cast<float>(j);
    float residual = 0.0F, information = 0.0F;
    for (Index k = 0; k < count; ++k) {
      const bool is_own = pixels.station[k] == station;
      residual += is_own ? pixels.residuals.projection[k] : 0.0F;
      information += is_own ? pixels.residuals.information[k] : 0.0F;
    }
    sums(j, STATION_RESIDUAL) += residual;
    sums(j, STATION_INFORMATION) += information;
  }
}

}  // namespace cmp::refine
