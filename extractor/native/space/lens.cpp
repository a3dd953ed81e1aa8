#include "space/lens.hpp"

#include <cmath>

namespace cmp::space {

namespace {

// The radial factor and its derivative by r^2.
struct Radial {
  double factor, by_square;
};

Radial fisheye(const Lens& lens, double square) {
  const auto& k = lens.k;
  const double radius = std::sqrt(square), angle = std::atan(radius), t = angle * angle;
  const bool is_near = square < lens.limits.axis * lens.limits.axis;
  const double share = is_near ? 1.0 - square / 3.0 : angle / radius;
  const double factor = share * (1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3]))));
  const double slope = 1.0 + t * (3 * k[0] + t * (5 * k[1] + t * (7 * k[2] + t * 9 * k[3])));
  // d (t_d / r) / d r^2 = (t_d' / (1 + r^2) - t_d / r) / (2 r^2)
  return {factor, is_near ? k[0] - 1.0 / 3.0 : (slope / (1.0 + square) - factor) / (2.0 * square)};
}

Radial rational(const Lens& lens, double square) {
  const auto& k = lens.k;
  const double above = 1.0 + square * (k[0] + square * (k[1] + square * k[4]));
  const double below = 1.0 + square * (k[5] + square * (k[6] + square * k[7]));
  const double factor = above / below;
  const double slope_above = k[0] + square * (2 * k[1] + 3 * k[4] * square);
  const double slope_below = k[5] + square * (2 * k[6] + 3 * k[7] * square);
  return {factor, (slope_above - factor * slope_below) / below};
}

double length(const Vector<2>& v) { return std::hypot(v[0], v[1]); }

// By which a place at this distance from the axis is multiplied for a first direction.
double start_factor(const Lens& lens, double radius) {
  if (radius == 0.0) return 0.0;
  const double wanted = lens.is_fisheye ? std::tan(std::min(radius, lens.limits.start_rad)) : radius;
  return std::min(wanted, 0.9 * lens.fold_radius) / radius;
}

}  // namespace

Place distorted(const Lens& lens, const Vector<2>& direction) {
  const double x = direction[0], y = direction[1], square = x * x + y * y;
  const Radial radial = lens.is_fisheye ? fisheye(lens, square) : rational(lens, square);
  const double slope = 2.0 * radial.by_square;
  Place out{radial.factor * direction,
            {{radial.factor + slope * x * x, slope * x * y, slope * x * y, radial.factor + slope * y * y}}};
  if (lens.is_fisheye) return out;
  const double p1 = lens.k[2], p2 = lens.k[3];
  const double s1 = lens.k[8], s2 = lens.k[9], s3 = lens.k[10], s4 = lens.k[11];
  out.xy[0] += 2 * p1 * x * y + p2 * (square + 2 * x * x) + square * (s1 + s2 * square);
  out.xy[1] += p1 * (square + 2 * y * y) + 2 * p2 * x * y + square * (s3 + s4 * square);
  const double prism_x = 2 * (s1 + 2 * s2 * square), prism_y = 2 * (s3 + 2 * s4 * square);
  out.by_direction += {{2 * p1 * y + 6 * p2 * x + prism_x * x, 2 * p1 * x + 2 * p2 * y + prism_x * y,
                        2 * p1 * x + 2 * p2 * y + prism_y * x, 6 * p1 * y + 2 * p2 * x + prism_y * y}};
  return out;
}

Vector<2> undistorted(const Lens& lens, const Vector<2>& place) {
  const double radius = length(place), limit = 1.0 + radius;
  Vector<2> direction = start_factor(lens, radius) * place;
  Place now = distorted(lens, direction);
  double error = length(place - now.xy);
  for (std::int64_t k = 0; k < lens.limits.max_iterations && error > lens.limits.converged * limit; ++k) {
    const Vector<2> residual = place - now.xy;
    const auto& d = now.by_direction;
    const double determinant = d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0);
    Vector<2> step{{(d(1, 1) * residual[0] - d(0, 1) * residual[1]) / determinant,
                    (d(0, 0) * residual[1] - d(1, 0) * residual[0]) / determinant}};
    bool is_moved = false;
    for (std::int64_t half = 0; half < lens.limits.max_halvings && step.is_finite() && !is_moved; ++half) {
      const Vector<2> tried = direction + step;
      const Place there = distorted(lens, tried);
      is_moved = length(place - there.xy) < error && length(tried) < lens.fold_radius;
      if (is_moved) {
        direction = tried;
        now = there;
        error = length(place - now.xy);
      }
      step *= 0.5;
    }
    if (!is_moved) break;
  }
  const auto& d = now.by_direction;
  const bool is_valid = error < lens.limits.accepted * limit && length(direction) < lens.fold_radius &&
                        d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0) > 0.0;
  return is_valid ? direction : Vector<2>::filled(NOT_A_NUMBER);
}

}  // namespace cmp::space
