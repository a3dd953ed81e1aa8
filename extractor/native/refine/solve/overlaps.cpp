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

// The overlap of near end with near end, of near end with the far end of the second gridline, and of near end
// with the far end of the first.
struct Overlap {
  double near, far_second, far_first;
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
  return {std::max(near, 0.0), linear * second - square, linear * first - square};
}

}  // namespace

void accumulate_overlaps(MarkerGridlines& at, double sigma, const SharedPixelLimits& limits) {
  const SharedPixelLimits own_limits = limits;
  for (Index i = 0; i < MARKER_GRIDLINES; ++i) {
    LaneGridlines one = at[i];  // a copy of its own cannot overlap the others, as the compiler sees
    for (Index j = i + 1; j < MARKER_GRIDLINES; ++j) {
      LaneGridlines& other = at[j];
      for (Index k = 0; k < MARKER_LANES; ++k) {
        const double color =
            one.red[k] * other.red[k] + one.green[k] * other.green[k] + one.blue[k] * other.blue[k];
        const double dot = color * std::min(one.weight[k], other.weight[k]);
        const double cosine = one.x[k] * other.x[k] + one.y[k] * other.y[k];
        const Overlap shared =
            overlap(cosine, one.inverse_length[k], other.inverse_length[k], sigma, own_limits);
        const double near = dot * shared.near, to_one = dot * shared.far_first,
                     to_other = dot * shared.far_second;
        one.near_x[k] += near * other.normal_x[k];
        one.near_y[k] += near * other.normal_y[k];
        one.far_x[k] += to_one * other.normal_x[k];
        one.far_y[k] += to_one * other.normal_y[k];
        other.near_x[k] += near * one.normal_x[k];
        other.near_y[k] += near * one.normal_y[k];
        other.far_x[k] += to_other * one.normal_x[k];
        other.far_y[k] += to_other * one.normal_y[k];
      }
    }
    at[i] = one;
  }
}

}  // namespace cmp::refine
