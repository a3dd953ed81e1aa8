#include "refine/solve/overlaps.hpp"

#include <cmath>
#include <numbers>

namespace cmp::refine {

namespace {

using Form = std::array<double, CLOSED_FORM_TERMS>;

inline double polynomial(const Form& form, double r) {
  double value = form[CLOSED_FORM_TERMS - 1];
  for (Index k = CLOSED_FORM_TERMS - 2; k >= 0; --k) value = form[k] + r * value;
  return value;
}

// The overlap of near end with near end, and of the near end of the other gridline with the far end of one.
struct Overlap {
  double near, far_first, far_second;
};

// The overlap of the derivatives by two gridlines that leave one marker at an angle; first and second, 1/px,
// 1 / length of each; sigma, the blur, px.
inline Overlap overlap(double cosine, double first, double second, double sigma,
                       const SharedPixelLimits& limits) {
  const double rest = 1.0 - std::min(std::max(cosine, -1.0), limits.max_cosine);
  const double per = 1.0 / std::sqrt(rest);
  const double r = rest * per;
  const double linear = sigma * per * per / (2.0 * std::sqrt(std::numbers::pi));
  const double form = polynomial(limits.linear_form, r);
  const double square = sigma * sigma * per * per * per * form / std::numbers::pi * first * second;
  const double plain = per * polynomial(limits.plain_form, r) / (2.0 * std::numbers::pi);
  const double near = plain - linear * (first + second) + square;
  return {std::max(near, 0.0), linear * first - square, linear * second - square};
}

// Calls act(first, second, pair) for the pairs of gridlines at a marker.
template <class Act>
inline void for_pairs(const Act& act) {
  std::size_t pair = 0;
  for (std::size_t i = 0; i < MARKER_GRIDLINES; ++i) {
    for (std::size_t j = i + 1; j < MARKER_GRIDLINES; ++j) act(i, j, pair++);
  }
}

}  // namespace

MarkerOverlaps overlaps_of(const AtMarkers<LaneGridlines>& at, double sigma,
                           const SharedPixelLimits& limits) {
  MarkerOverlaps out;
  const SharedPixelLimits own_limits = limits;
  for_pairs([&](std::size_t i, std::size_t j, std::size_t pair) {
    const LaneGridlines &one = at[i], &other = at[j];
    for (std::size_t k = 0; k < MARKER_LANES; ++k) {
      const double color =
          one.red[k] * other.red[k] + one.green[k] * other.green[k] + one.blue[k] * other.blue[k];
      const double cosine = one.x[k] * other.x[k] + one.y[k] * other.y[k];
      const Overlap own = overlap(cosine, one.inverse_length[k], other.inverse_length[k], sigma, own_limits);
      out[pair].near[k] = color * own.near;
      out[pair].far_first[k] = color * own.far_first;
      out[pair].far_second[k] = color * own.far_second;
    }
  });
  return out;
}

AtMarkers<LaneInformation> information_of(const MarkerOverlaps& overlaps, const AtMarkers<LaneNormals>& at) {
  AtMarkers<LaneInformation> out{};
  for_pairs([&](std::size_t i, std::size_t j, std::size_t pair) {
    const LaneNormals &one = at[i], &other = at[j];
    LaneInformation &own = out[i], &others = out[j];
    for (std::size_t k = 0; k < MARKER_LANES; ++k) {
      const double weight = std::min(one.weight[k], other.weight[k]);
      const double near = weight * overlaps[pair].near[k], to_one = weight * overlaps[pair].far_first[k],
                   to_other = weight * overlaps[pair].far_second[k];
      own.near_x[k] += near * other.x[k];
      own.near_y[k] += near * other.y[k];
      own.far_x[k] += to_one * other.x[k];
      own.far_y[k] += to_one * other.y[k];
      others.near_x[k] += near * one.x[k];
      others.near_y[k] += near * one.y[k];
      others.far_x[k] += to_other * one.x[k];
      others.far_y[k] += to_other * one.y[k];
    }
  });
  return out;
}

AtMarkers<LaneEnds> gradients_of(const MarkerOverlaps& overlaps, const AtMarkers<LaneEnds>& shift) {
  AtMarkers<LaneEnds> out{};
  for_pairs([&](std::size_t i, std::size_t j, std::size_t pair) {
    const LaneEnds &one = shift[i], &other = shift[j];
    LaneEnds &own = out[i], &others = out[j];
    for (std::size_t k = 0; k < MARKER_LANES; ++k) {
      const double near = overlaps[pair].near[k], to_one = overlaps[pair].far_first[k],
                   to_other = overlaps[pair].far_second[k];
      own.near[k] += near * other.near[k] + to_other * other.far[k];
      own.far[k] += to_one * other.near[k];
      others.near[k] += near * one.near[k] + to_one * one.far[k];
      others.far[k] += to_other * one.near[k];
    }
  });
  return out;
}

}  // namespace cmp::refine
