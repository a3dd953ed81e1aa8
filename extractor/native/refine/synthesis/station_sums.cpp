#include "refine/synthesis/station_sums.hpp"

#include <cmath>

#include "base/processor.hpp"

namespace cmp::refine {

namespace {

// Fills in the station that each pixel belongs to.
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
        pixels.station[j * lanes + i] = std::floor(t * intervals - 0.5F);
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
      const float own = pixels.weights.to_a[k] + pixels.weights.to_b[k];
      const float g = pixels.station[k] == station ? own : 0.0F;
      residual += g * pixels.residuals.projection[k];
      information += g * g * pixels.residuals.information[k];
    }
    sums(j, STATION_RESIDUAL) += residual;
    sums(j, STATION_INFORMATION) += information;
  }
}

}  // namespace cmp::refine
