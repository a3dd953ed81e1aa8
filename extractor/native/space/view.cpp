#include "space/view.hpp"

#include <cmath>

namespace cmp::space {

namespace {

// The sideways offset per depth over the tangent q: k(q; m) of extractor/space/medium.py.
double sideways(double tangent, double index) {
  return 1.0 / std::sqrt(index * index + (index * index - 1.0) * tangent * tangent);
}

// r / q and dr / dq.
struct Depths {
  double depth, slope;
};

Depths apparent_depth(const Window& window, double gel_mm, double tangent) {
  const double in_window = sideways(tangent, window.window_index),
               in_gel = sideways(tangent, window.gel_index);
  const double by_window = window.window_index * window.window_index * in_window * in_window * in_window;
  const double by_gel = window.gel_index * window.gel_index * in_gel * in_gel * in_gel;
  return {window.distance_mm + window.window_mm * in_window + gel_mm * in_gel,
          window.distance_mm + window.window_mm * by_window + gel_mm * by_gel};
}

double solved_tangent(const Window& window, double gel_mm, double radius_mm) {
  double tangent = radius_mm / (window.distance_mm + window.window_mm + gel_mm);
  for (std::int64_t k = 0; k < window.limits.max_iterations; ++k) {
    const auto [depth, slope] = apparent_depth(window, gel_mm, tangent);
    const double step = (radius_mm - tangent * depth) / slope;
    tangent += step;
    if (!(std::abs(step) > window.limits.converged * (1.0 + tangent))) break;
  }
  return tangent;
}

// The direction in which the camera sees a point, of any length, and its derivatives.
struct Sight {
  Vector<3> xyz;
  Matrix<3, 3> by_point;
  Matrix<3, 6> by_pose;
};

// Derivatives of a point, along the camera's axes from the layout's origin, by the pose.
Matrix<3, 6> point_by_pose(const Vector<3>& rotated) {
  const Matrix<3, 3> turn = cross_matrix(rotated);
  Matrix<3, 6> out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(i, j) = -turn(i, j);
    out(i, 3 + i) = 1.0;
  }
  return out;
}

Sight refracted(const Window& window, const Vector<3>& rotated, const Vector<3>& camera) {
  const Vector<3>& n = window.normal;
  const double gel = window.gel_depth_mm(camera), along_n = dot(camera, n);
  const Vector<3> beside = camera - along_n * n;
  const double radius = std::sqrt(dot(beside, beside));
  const Vector<3> outward = radius > 0.0 ? (1.0 / radius) * beside : Vector<3>{};
  const double tangent = solved_tangent(window, gel, radius);
  const auto [depth, slope] = apparent_depth(window, gel, tangent);
  const double in_gel = tangent * sideways(tangent, window.gel_index);
  const auto unit = Matrix<3, 3>::unit(), radial = outward * outward.transposed();
  // by the part of the point across the normal
  const Matrix<3, 3> across = (1.0 / slope) * radial + (1.0 / depth) * (unit - radial);
  const Vector<3> along = (in_gel / slope) * outward;
  const Matrix<3, 3> by_point = across - (across * n + along) * n.transposed();
  const Matrix<3, 3> by_normal = unit - ((1.0 / depth) * n + along) * beside.transposed() - along_n * across;
  const Vector<3> by_distance = ((in_gel - tangent) / slope) * outward;
  return {n + tangent * outward, by_point,
          by_point * point_by_pose(rotated) + by_normal * window.normal_by_pose +
              by_distance * window.distance_by_pose.transposed()};
}

}  // namespace

double Window::gel_depth_mm(const Vector<3>& camera) const {
  const double depth = dot(camera, normal) - distance_mm - window_mm;
  return depth >= -limits.touching_mm && distance_mm > 0.0 ? std::max(depth, 0.0) : NOT_A_NUMBER;
}

bool PlacedView::is_ahead(const Vector<3>& xyz_mm) const {
  const Vector<3> camera = rotation * xyz_mm + shift_mm;
  return window.is_there ? std::isfinite(window.gel_depth_mm(camera)) : camera[2] > 0.0;
}

Picture picture(const PlacedView& view, const Vector<3>& xyz_mm) {
  const Vector<3> rotated = view.rotation * xyz_mm, camera = rotated + view.shift_mm;
  const Sight sight = view.window.is_there ? refracted(view.window, rotated, camera)
                                           : Sight{camera, Matrix<3, 3>::unit(), point_by_pose(rotated)};
  const double z = sight.xyz[2];
  const Vector<2> direction{{sight.xyz[0] / z, sight.xyz[1] / z}};
  if (!(z > 0.0) || !(std::hypot(direction[0], direction[1]) < view.lens.fold_radius))
    return {Vector<2>::filled(NOT_A_NUMBER), Vector<2>::filled(NOT_A_NUMBER),
            Matrix<2, 3>::filled(NOT_A_NUMBER), Matrix<2, 6>::filled(NOT_A_NUMBER)};
  const Place place = distorted(view.lens, direction);
  const Matrix<2, 3> by_sight{{1.0 / z, 0.0, -direction[0] / z, 0.0, 1.0 / z, -direction[1] / z}};
  const Matrix<2, 2> focal{{view.focal_px[0], 0.0, 0.0, view.focal_px[1]}};
  const Matrix<2, 3> by_camera = focal * place.by_direction * by_sight;
  return {focal * place.xy + view.centre_px, direction, by_camera * sight.by_point * view.rotation,
          by_camera * sight.by_pose};
}

Ray ray(const PlacedView& view, const Vector<2>& xy_px) {
  const Vector<2> seen = undistorted(view.lens, {{(xy_px[0] - view.centre_px[0]) / view.focal_px[0],
                                                  (xy_px[1] - view.centre_px[1]) / view.focal_px[1]}});
  Vector<3> origin, direction{{seen[0], seen[1], 1.0}};
  const Window& window = view.window;
  if (window.is_there) {
    const Vector<3>& n = window.normal;
    double forward = dot(direction, n);
    if (!(forward > 0.0 && window.distance_mm > 0.0)) forward = NOT_A_NUMBER;
    const Vector<3> beside = (1.0 / forward) * direction - n;
    const double tangent = std::sqrt(dot(beside, beside));
    const double away = window.distance_mm + window.window_mm * sideways(tangent, window.window_index);
    origin = (window.distance_mm + window.window_mm) * n + away * beside;
    direction = n + sideways(tangent, window.gel_index) * beside;
  }
  direction *= 1.0 / std::sqrt(dot(direction, direction));
  const Matrix<3, 3> back = view.rotation.transposed();
  return {back * (origin - view.shift_mm), back * direction};
}

}  // namespace cmp::space
