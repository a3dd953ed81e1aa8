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

}  // namespace

MarkerOverlaps overlaps_of(const MarkerGridlines& at, double sigma, const SharedPixelLimits& limits) {
  MarkerOverlaps out;
  const SharedPixelLimits own_limits = limits;
  std::size_t pair = 0;
  for (std::size_t i = 0; i < MARKER_GRIDLINES; ++i) {
    const LaneGridlines& one = at[i];
    for (std::size_t j = i + 1; j < MARKER_GRIDLINES; ++j, ++pair) {
      const LaneGridlines& other = at[j];
      LaneOverlaps& shared = out[pair];
#pragma omp simd
      for (std::size_t k = 0; k < MARKER_LANES; ++k) {
        const double color =
            one.red[k] * other.red[k] + one.green[k] * other.green[k] + one.blue[k] * other.blue[k];
        const double cosine = one.x[k] * other.x[k] + one.y[k] * other.y[k];
        const Overlap own = overlap(cosine, one.inverse_length[k], other.inverse_length[k], sigma, own_limits);
        shared.near[k] = color * own.near;
        shared.far_first[k] = color * own.far_first;
        shared.far_second[k] = color * own.far_second;
      }
    }
  }
  return out;
}

}  // namespace cmp::refine
