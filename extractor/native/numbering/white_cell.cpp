#include "numbering/white_cell.hpp"

#include <cmath>
#include <limits>
#include <optional>

#include "numbering/white_prediction.hpp"
#include "numeric/bilinear.hpp"
#include "numeric/bilinear_batch.hpp"

namespace cmp::numbering {

namespace {

using numeric::BATCH_POINTS;
using numeric::COLOR;
using numeric::INSIDE;
using numeric::RADIUS;
using numeric::X;
using numeric::Y;

using Color = std::array<double, 3>;

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr double ONE_STEP = 1.0;  // of a channel, the least that the strongest ink has
constexpr int FIRST_INK = 1, INKS = 4;
// The corners of a down-cell relative to its center, in axial steps: below, upper right and upper left.
constexpr std::array<PlanePoint, 3> CORNERS{{{1.0 / 3, -2.0 / 3}, {1.0 / 3, 1.0 / 3}, {-2.0 / 3, 1.0 / 3}}};

Color color_of(View<const double, 1> values) { return {values[0], values[1], values[2]}; }

// The colors around one place that may be the white cell.
class WhitePlace {
 public:
  WhitePlace(View<const std::uint8_t, 3> image, const AxialMap& map, View<const double, 2> inks,
             View<const double, 1> black, const WhiteCellLimits& limits)
      : flat_(image.flat()),
        height_(image.size(0)),
        width_(image.size(1)),
        map_(map),
        limits_(limits),
        radius_(limits.sample_radius * std::sqrt(std::abs(map.qx * map.ry - map.rx * map.qy))) {
    for (int channel = 0; channel < 3; ++channel) {
      double most = inks(0, channel);
      for (int c = FIRST_INK; c < INKS; ++c) most = std::max(most, inks(c, channel));
      strongest_[channel] = std::max(most, ONE_STEP);
    }
    ground_ = whiteness(color_of(black));
    for (int c = FIRST_INK; c < INKS; ++c) ground_ = std::max(ground_, whiteness(color_of(inks[c])));
  }

  // The center of the white cell; NaN if it is not at its predicted center.
  PlanePoint verified_center() {
    const PlanePoint predicted = map_.center;
    if (is_white_triangle()) return predicted;
    // the centroid is more accurate than the map, unless something white is next to the cell
    const PlanePoint step = white_centroid();
    const double square = step.x * step.x + step.x * step.y + step.y * step.y;
    if (!(square <= limits_.max_centroid_distance * limits_.max_centroid_distance)) return {NOWHERE, NOWHERE};
    map_.center = {predicted.x + (map_.qx * step.x + map_.rx * step.y),
                   predicted.y + (map_.qy * step.x + map_.ry * step.y)};
    if (is_white_triangle()) return map_.center;
    return {NOWHERE, NOWHERE};
  }

 private:
  // The weakest channel of a color, relative to the inks' maximum of that channel.
  double whiteness(const Color& color) const {
    return std::min({color[0] / strongest_[0], color[1] / strongest_[1], color[2] / strongest_[2]});
  }
  double whiteness_above_ground(const Color& color) const { return whiteness(color) - ground_; }

  // The mean color at the axial vector (u, v) from the center; none outside the image.
  std::optional<Color> mean_color(double u, double v) const {
    Color own;
    const PlanePoint place = map_.image_point(u, v);
    if (!numeric::fill_patch_mean(flat_, height_, width_, place.x, place.y, radius_, {own.data(), {3}}))
      return std::nullopt;
    return own;
  }

  // The axial vector to the centroid of the whiteness above the ground; NaN where nothing is whiter.
  PlanePoint white_centroid() const {
    const auto points = limits_.points.centroid;
    auto buffers = numeric::allocate_sample_buffers();
    const auto patches = buffers.patches.view();
    for (Index n = 0; n < points.size(); ++n) {
      const PlanePoint place = map_.image_point(points(n, 0), points(n, 1));
      patches[X + n] = place.x;
      patches[Y + n] = place.y;
      patches[RADIUS + n] = radius_;
    }
    numeric::fill_patch_means(flat_, height_, width_, points.size(), buffers);
    double total = 0.0, q = 0.0, r = 0.0;
    for (Index n = 0; n < points.size(); ++n) {
      if (!(patches[INSIDE + n] > 0.0)) continue;
      Color own;
      for (int channel = 0; channel < 3; ++channel)
        own[channel] = patches[COLOR + channel * BATCH_POINTS + n];
      const double weight = std::max(whiteness_above_ground(own), 0.0);
      total += weight;
      q += weight * points(n, 0);
      r += weight * points(n, 1);
    }
    return total > 0.0 ? PlanePoint{q / total, r / total} : PlanePoint{NOWHERE, NOWHERE};
  }

  // Whether the cell is white inside and nowhere outside; no point outside the image is white.
  bool is_white_triangle() const {
    const auto inside = limits_.points.inside, outside = limits_.points.outside;
    const auto middle = mean_color(0.0, 0.0);
    if (!middle) return false;
    const double reach = std::max(whiteness_above_ground(*middle), limits_.min_reach);
    for (Index n = 0; n < inside.size(); ++n) {
      const auto own = mean_color(inside(n, 0), inside(n, 1));
      if (!own) return false;
      const double least = n < static_cast<Index>(CORNERS.size()) ? limits_.min_corner : limits_.min_inside;
      if (whiteness_above_ground(*own) < least * reach) return false;
    }
    for (Index n = 0; n < outside.size(); ++n) {
      const auto own = mean_color(outside(n, 0), outside(n, 1));
      if (own && whiteness_above_ground(*own) > limits_.max_outside * reach) return false;
    }
    return true;
  }

  View<const std::uint8_t, 1> flat_;
  Index height_, width_;
  AxialMap map_;
  const WhiteCellLimits& limits_;
  double radius_;  // of a color sample, px
  Color strongest_;
  double ground_;  // whiteness of black, or of the palest ink
};

}  // namespace

PlanePoint locate_white_cell(View<const std::uint8_t, 3> image, View<const double, 2> center_px,
                             View<const std::int32_t, 1> cell, const WhiteCellLayout& layout,
                             View<const double, 2> inks, View<const double, 1> black,
                             const WhiteCellLimits& limits) {
  const AxialMap map = predict_white_cell(center_px, cell, layout, limits);
  if (std::isnan(map.center.x)) return map.center;
  return WhitePlace(image, map, inks, black, limits).verified_center();
}

}  // namespace cmp::numbering
