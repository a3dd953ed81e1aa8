#include "refine/synthesis/residual_kernel.hpp"

#include <memory>

#include "base/parts.hpp"
#include "refine/synthesis/residual_sums.hpp"
#include "refine/synthesis/station_sums.hpp"

namespace cmp::refine {

namespace {

// The thread's memory for the pixels of a gridline: to write zeros to fresh memory takes longer than to reuse
// it. Rows that fill up the lanes keep numbers of earlier gridlines, with the weight 0.
GridlinePixels& kept_pixels() {
  static thread_local const auto pixels = std::make_unique<GridlinePixels>();
  return *pixels;
}

// Adds the pixels of gridlines to their sums.
class ResidualReader {
 public:
  ResidualReader(const image::PyramidLevel& view, View<const float, 3> model, const DrawnGridlines& drawn,
                 double sigma, View<const std::int64_t, 1> box, const PixelRowLimits& limits)
      : drawn_(drawn),
        area_{box[0], box[1], box[2], box[3]},
        width_(view.image.size(1)),
        sigma_(sigma),
        reach_(limits.band * sigma),
        pixels_(kept_pixels()) {
    const Index start = 3 * (area_.y_from * width_ + area_.x_from);
    images_ = {view.image.flat().from(start), model.flat().from(start), view.response.encoded};
  }

  // Fills in the sums (24,) over the pixels near gridline e, and those at its stations (m, 2).
  void read(Index e, View<double, 1> sums, View<double, 2> stations) {
    sums.fill(0.0);
    stations.flat().fill(0.0);
    const SideLight light = side_light(drawn_.sides, drawn_.added, e);
    const auto [c0, c1, c2] = light.contrast;
    if (drawn_.lines(e, KNOWN) == 0.0 || c0 * c0 + c1 * c1 + c2 * c2 == 0.0F) return;
    const SideLight bleed = side_light(drawn_.sides, drawn_.bleed, e);
    const RowFrame frame = row_frame(drawn_.lines, e, area_, width_);
    const PixelGeometry line = pixel_geometry(frame, sigma_);
    const WeightReach weights = weight_reach(reach_, sigma_, frame.length);
    const double p_end = frame.p + frame.length * frame.up, half = reach_ / std::abs(frame.up);
    const auto begin = std::max<Index>(static_cast<Index>(std::ceil(std::min(frame.p, p_end) - reach_)), 0);
    const auto last =
        std::min(static_cast<Index>(std::floor(std::max(frame.p, p_end) + reach_)), frame.p_count - 1);
    const RowSizes sizes = row_sizes(half, frame.q_count);
    for (Index first = begin; first <= last; first += sizes.most) {
      const RowBlock block{std::min(sizes.most, last + 1 - first), sizes.wide, frame.step_q};
      fill_rows(block, first, frame, half, pixels_.rows);
      fill_weights(block, line, weights, pixels_);
      fill_values(images_, block, pixels_.rows, light, pixels_.weights.before_share, pixels_.residuals);
      accumulate_sums(light, bleed, block.pixels(), pixels_, sums);
      if (drawn_.is_bending[e]) accumulate_bending_sums(pixels_, block.pixels(), sums);
      accumulate_station_sums(block, line, pixels_, stations);
    }
    update_units(sums, 1.0 / sigma_);
  }

 private:
  // Multiplies a gridline's sums (24,) by the powers of 1 / blur that they lack.
  static void update_units(View<double, 1> sums, double inverse) {
    for (const Index k :
         {AA, AB, BB, BLUR_CURVATURE, A_BLUR, B_BLUR, C_BLUR, D_BLUR, AC, AD, BC, BD, CC, CD, DD})
      sums[k] *= inverse * inverse;
    for (const Index k : {A, B, BLUR, C, D}) sums[k] *= inverse;
  }

  DrawnGridlines drawn_;
  ImageArea area_;
  Index width_;
  double sigma_, reach_;  // px
  ComparedImages images_;
  GridlinePixels& pixels_;
};

}  // namespace

ResidualSums accumulate_residual_sums(const image::PyramidLevel& view, View<const float, 3> model,
                                      const DrawnGridlines& drawn, double sigma,
                                      View<const std::int64_t, 1> box, Index stations,
                                      const PixelRowLimits& limits) {
  const Index edges = drawn.lines.size();
  ResidualSums out{Array<double, 2>({edges, SUMS}), Array<double, 3>({edges, stations, STATION_SUMS})};
  in_parts(edges, edges, [&](Index begin, Index end) {
    ResidualReader reader(view, model, drawn, sigma, box, limits);
    for (Index e = begin; e < end; ++e) reader.read(e, out.ends[e], out.stations[e]);
  });
  return out;
}

}  // namespace cmp::refine
