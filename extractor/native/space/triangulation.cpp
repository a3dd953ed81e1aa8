#include "space/triangulation.hpp"

#include <algorithm>
#include <cmath>

namespace cmp::space {

namespace {

// PointReason in extractor/space/triangulation.py
constexpr std::uint8_t FOUND = 0, UNSEEN = 1, ONE_VIEW = 2, NO_RAY = 3, PARALLEL = 4, DISAGREE = 5;

// A point's pixel in a view.
struct Seen {
  const PlacedView* view;
  int number;  // of the view
  Vector<2> xy_px;
  Matrix<2, 2> weight;  // inverse covariance
};

// The pixels of a point.
struct Pixels {
  int count = 0;
  std::array<Seen, MAX_VIEWS> seen;
};

// Residuals of a point and their derivatives in every view that shows it.
struct Residuals {
  std::array<Vector<2>, MAX_VIEWS> px;
  std::array<Picture, MAX_VIEWS> pictures;
  double chi_square = 0.0;
};

// A point and what the steps know of it; made once, for all points.
struct Solution {
  Vector<3> xyz_mm;
  Residuals residuals, tried;
  Matrix<3, 3> cov_mm2;

  void take_tried(int count) {
    std::copy_n(tried.px.begin(), count, residuals.px.begin());
    std::copy_n(tried.pictures.begin(), count, residuals.pictures.begin());
    residuals.chi_square = tried.chi_square;
  }
};

// Adds a view's pixel where it is known and its covariance is positive definite.
void add_pixel(Pixels& pixels, const PlacedView& view, int number, View<const double, 1> xy,
               View<const double, 2> cov) {
  const Vector<2> place{{xy[0], xy[1]}};
  const auto c = Matrix<2, 2>::copied(cov);
  const double determinant = c(0, 0) * c(1, 1) - c(0, 1) * c(1, 0);
  if (!place.is_finite() || !c.is_finite() || !(c(0, 0) > 0.0) || !(determinant > 0.0)) return;
  const Matrix<2, 2> weight{
      {c(1, 1) / determinant, -c(0, 1) / determinant, -c(1, 0) / determinant, c(0, 0) / determinant}};
  pixels.seen[static_cast<std::size_t>(pixels.count++)] = {&view, number, place, weight};
}

// The point nearest to all rays, and why there is none.
//
// Where the rays meet behind a camera or before its window, the point is that of its ray on the layout's
// plane.
std::uint8_t find_start(const Pixels& pixels, const TriangulationLimits& limits, Vector<3>& start) {
  std::array<Ray, MAX_VIEWS> rays;
  Matrix<3, 3> normal;
  Vector<3> right;
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    rays[k] = ray(*pixels.seen[k].view, pixels.seen[k].xy_px);
    if (!rays[k].direction.is_finite()) return NO_RAY;
    const Matrix<3, 3> across = Matrix<3, 3>::unit() - rays[k].direction * rays[k].direction.transposed();
    normal += across;
    right += across * rays[k].origin_mm;
  }
  if (!is_regular(normal, limits.min_ray_divergence)) return PARALLEL;
  start = scaled_inverse(normal, 0.0) * right;
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    if (pixels.seen[k].view->is_ahead(start)) continue;
    const Ray& one = rays[k];
    start = one.origin_mm - (one.origin_mm[2] / one.direction[2]) * one.direction;
  }
  return start.is_finite() ? FOUND : PARALLEL;
}

void fill_residuals(const Pixels& pixels, const Vector<3>& xyz_mm, const TriangulationLimits& limits,
                    Residuals& out) {
  out.chi_square = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    const Seen& seen = pixels.seen[k];
    out.pictures[k] = picture(*seen.view, xyz_mm);
    out.px[k] = seen.xy_px - out.pictures[k].xy_px;
    if (!out.px[k].is_finite()) {  // no picture there: such a step is refused
      out.px[k] = Vector<2>::filled(limits.large_residual_px);
      out.pictures[k].by_point = {};
      out.pictures[k].by_pose = {};
    }
    out.chi_square += dot(out.px[k], seen.weight * out.px[k]);
  }
}

// The information matrix of a point, and the gradient.
Matrix<3, 3> normal_of(const Pixels& pixels, const Residuals& residuals, Vector<3>& gradient) {
  Matrix<3, 3> normal;
  gradient = {};
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    const Matrix<3, 2> design = residuals.pictures[k].by_point.transposed() * pixels.seen[k].weight;
    normal += design * residuals.pictures[k].by_point;
    gradient += design * residuals.px[k];
  }
  return normal;
}

// Damped Gauss-Newton steps.
void solve(const Pixels& pixels, const Vector<3>& start, const TriangulationLimits& limits, Solution& now) {
  now.xyz_mm = start;
  fill_residuals(pixels, start, limits, now.residuals);
  double damping = 0.0;
  Vector<3> gradient;
  for (std::int64_t k = 0; k < limits.iterations; ++k) {
    Matrix<3, 3> damped = normal_of(pixels, now.residuals, gradient);
    for (int i = 0; i < 3; ++i) damped(i, i) *= 1.0 + damping;
    const Matrix<3, 3> inverse = scaled_inverse(damped, limits.min_eigenvalue);
    const Vector<3> step = inverse.is_finite() ? inverse * gradient : Vector<3>{};
    const Vector<3> there = now.xyz_mm + step;
    fill_residuals(pixels, there, limits, now.tried);
    const bool is_better = now.tried.chi_square <= now.residuals.chi_square * (1 + 1e-12);
    if (is_better) {
      now.xyz_mm = there;
      now.take_tried(pixels.count);
    }
    damping = is_better ? damping / 10.0 : std::max(10.0 * damping, limits.min_damping);
    if (!(dot(step, gradient) > limits.converged * limits.converged)) break;
  }
  now.cov_mm2 = scaled_inverse(normal_of(pixels, now.residuals, gradient), limits.min_eigenvalue);
}

// The derivatives of a point by all poses, (3, 6 V).
void fill_by_pose(const Pixels& pixels, const Solution& found, View<double, 2> by_pose) {
  Matrix<3, 3> bounded = found.cov_mm2;  // points with infinite variances are rejected later
  for (double& value : bounded.values) value = std::isfinite(value) ? value : 0.0;
  by_pose.fill(0.0);
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    const Picture& shown = found.residuals.pictures[k];
    const Matrix<3, 6> own =
        -1.0 * (bounded * (shown.by_point.transposed() * pixels.seen[k].weight * shown.by_pose));
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 6; ++j) by_pose(i, 6 * pixels.seen[k].number + j) = own(i, j);
  }
}

// The degrees of freedom of the squared residuals: those of the pixels, and what the poses add.
double freedom(const Pixels& pixels, const Solution& found, View<const double, 2> by_pose,
               View<const double, 2> cov_pose) {
  double sum = 2.0 * pixels.count - 3.0;
  const Index size = cov_pose.size();
  for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k) {
    const Seen& seen = pixels.seen[k];
    const Picture& shown = found.residuals.pictures[k];
    std::array<std::array<double, 6 * MAX_VIEWS>, 2> moved{}, spread{};
    for (Index j = 0; j < size; ++j)
      for (int i = 0; i < 2; ++i) {
        double value = 0.0;
        for (int c = 0; c < 3; ++c) value += shown.by_point(i, c) * by_pose(c, j);
        const Index own = j - 6 * seen.number;
        if (own >= 0 && own < 6) value += shown.by_pose(i, static_cast<int>(own));
        moved[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = value;
      }
    for (std::size_t i = 0; i < 2; ++i)
      for (Index j = 0; j < size; ++j)
        for (Index l = 0; l < size; ++l)
          spread[i][static_cast<std::size_t>(l)] += moved[i][static_cast<std::size_t>(j)] * cov_pose(j, l);
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t j = 0; j < 2; ++j) {
        double cov = 0.0;
        for (Index l = 0; l < size; ++l)
          cov += spread[i][static_cast<std::size_t>(l)] * moved[j][static_cast<std::size_t>(l)];
        sum += seen.weight(static_cast<int>(j), static_cast<int>(i)) * cov;
      }
  }
  return sum;
}

// Why a point is not reported.
std::uint8_t judged(const Matrix<3, 3>& cov, double misfit, double residual_px, const Gate& gate) {
  if (!cov.is_finite()) return PARALLEL;
  const double most = gate.max_sigma_mm * gate.max_sigma_mm;
  if (!(cov(0, 0) + cov(1, 1) + cov(2, 2) <= most) && !(eigenvalues(cov)[2] <= most)) return PARALLEL;
  return residual_px > gate.tolerance_px && misfit > gate.sigmas ? DISAGREE : FOUND;
}

}  // namespace

Points triangulate(const PlacedViews& views, View<const double, 3> xy_px, View<const double, 4> cov_px2,
                   View<const double, 2> cov_pose, const Gate& gate, const TriangulationLimits& limits) {
  const Index count = xy_px.size(1), poses = 6 * views.count;
  Array<double, 2> xyz({count, 3}, NOT_A_NUMBER);
  Array<double, 3> cov({count, 3, 3}, NOT_A_NUMBER), by_pose({count, 3, poses}, NOT_A_NUMBER);
  Array<double, 1> misfit({count}, NOT_A_NUMBER), inflation({count}, 1.0);
  Array<std::uint8_t, 1> reason({count}, FOUND);
  Solution found;
  for (Index p = 0; p < count; ++p) {
    Pixels pixels;
    for (int v = 0; v < views.count; ++v)
      add_pixel(pixels, views.views[static_cast<std::size_t>(v)], v, xy_px[v][p], cov_px2[v][p]);
    Vector<3> start;
    reason[p] = pixels.count == 0 ? UNSEEN : pixels.count == 1 ? ONE_VIEW : find_start(pixels, limits, start);
    if (reason[p] != FOUND) continue;
    solve(pixels, start, limits, found);
    fill_by_pose(pixels, found, by_pose[p]);
    misfit[p] = std::sqrt(found.residuals.chi_square / freedom(pixels, found, by_pose[p], cov_pose));
    if (misfit[p] > limits.inflation_sigmas) inflation[p] = misfit[p] * misfit[p];
    found.cov_mm2 *= inflation[p];
    double residual = 0.0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(pixels.count); ++k)
      residual += dot(found.residuals.px[k], found.residuals.px[k]);
    reason[p] = judged(found.cov_mm2, misfit[p], std::sqrt(residual), gate);
    if (reason[p] != FOUND) {
      by_pose[p].fill(NOT_A_NUMBER);
      continue;
    }
    found.xyz_mm.copy_to(xyz[p]);
    found.cov_mm2.copy_to(cov[p]);
  }
  return {std::move(xyz),    std::move(cov),       std::move(by_pose),
          std::move(misfit), std::move(inflation), std::move(reason)};
}

Array<double, 3> inverses(View<const double, 3> normal, const TriangulationLimits& limits) {
  Array<double, 3> out({normal.size(), 3, 3});
  for (Index k = 0; k < normal.size(); ++k)
    scaled_inverse(Matrix<3, 3>::copied(normal[k]), limits.min_eigenvalue).copy_to(out[k]);
  return out;
}

}  // namespace cmp::space
