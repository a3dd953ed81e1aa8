#include "track/ink_alignment.hpp"

#include <cmath>
#include <limits>

#include "numeric/dense_systems.hpp"
#include "track/ink_moments.hpp"

namespace cmp::track {

namespace {

using numeric::dot3;

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr double TRIANGLE_HEIGHT = 0.8660254037844386;  // of the equilateral triangle, in edges
constexpr double CELL_AREA_RATIO = 0.4330127018922193;  // its area relative to the square on its edge

// Writes the weights of the channels that give 1 for an ink, -1 for the two others and 0 for black.
//
// Returns false where the three inks are nearly coplanar.
bool fill_unmixing_weights(const std::array<View<const double, 1>, 3>& inks, double min_volume,
                           std::array<double, 3>& row) {
  std::array<double, 3> normal_memory;
  const View<double, 1> normal(normal_memory.data(), {3});
  row = {};
  for (int n = 0; n < 3; ++n) {
    const auto &a = inks[n], &b = inks[(n + 1) % 3], &c = inks[(n + 2) % 3];
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      normal[k] = b[i] * c[j] - b[j] * c[i];
    }
    const double volume = dot3(normal, a);
    if (!(std::abs(volume) > min_volume * std::sqrt(dot3(normal, normal) * dot3(a, a)))) return false;
    for (int k = 0; k < 3; ++k) row[k] += (n == 0 ? 1.0 : -1.0) * normal[k] / volume;
  }
  return true;
}

// The ellipse, relative to its search radius, around a cell's predicted middle.
struct SearchWindow {
  double x, y;    // the middle, px
  double area;    // of the parallelogram of the two axes, px^2
  double yy, xy;  // second moments of the axes, px^2
};

SearchWindow search_window(View<const double, 2> xy, View<const std::int32_t, 1> corners) {
  const auto a = xy[corners[0]], b = xy[corners[1]], c = xy[corners[2]];
  // images of the unit vectors along and across the edge a-b of the equilateral cell: the ellipse's axes
  const double ux = b[0] - a[0], uy = b[1] - a[1];
  const double vx = (c[0] - a[0] - 0.5 * ux) / TRIANGLE_HEIGHT,
               vy = (c[1] - a[1] - 0.5 * uy) / TRIANGLE_HEIGHT;
  const auto [x, y] = cell_middle(xy, corners);
  return {x, y, ux * vy - uy * vx, uy * uy + vy * vy, ux * uy + vx * vy};
}

// The moments of the ink in rows of pixels, and the distance of the rows, px.
struct WindowMoments {
  InkMoments sums;
  Index row_step;
};

WindowMoments window_moments(View<const std::uint8_t, 3> image, const SearchWindow& window,
                             const InkWeights& ink, const AlignmentLimits& limits) {
  const auto flat = image.flat();
  const Index height = image.size(0), width = image.size(1);
  const double radius = limits.search_radius, half_height = radius * std::sqrt(window.yy);
  const auto row_step =
      std::max<Index>(static_cast<Index>(2.0 * half_height / static_cast<double>(limits.min_rows)), 1);
  const auto top = std::max<Index>(static_cast<Index>(std::ceil(window.y - half_height)), 0);
  const auto bottom = std::min<Index>(static_cast<Index>(std::floor(window.y + half_height)), height - 1);
  InkMoments sums;
  PixelBlock block;
  for (Index y = top; y <= bottom; y += row_step) {
    const double offset = (static_cast<double>(y) - window.y) / window.yy;
    const double half_width =
        std::abs(window.area) * std::sqrt(std::max(radius * radius / window.yy - offset * offset, 0.0));
    const double middle = window.x + window.xy * offset;
    const auto start = std::max<Index>(static_cast<Index>(std::ceil(middle - half_width)), 0);
    const auto end = std::min<Index>(static_cast<Index>(std::floor(middle + half_width)), width - 1) + 1;
    for (Index x = start; x < end;) {
      x = append_pixels(flat, width, y, x, end, block);
      if (block.count < BLOCK_PIXELS) continue;
      add_ink_moments(block, window.x, window.y, ink, sums);
      block.count = 0;
    }
  }
  add_ink_moments(block, window.x, window.y, ink, sums);
  return {sums, row_step};
}

double distance(View<const double, 1> a, View<const double, 1> b) {
  const double dx = a[0] - b[0], dy = a[1] - b[1];
  return std::sqrt(dx * dx + dy * dy);
}

// Sums over the cells at each marker.
struct MarkerSums {
  Array<double, 2> shift;       // (M, 2) px
  Array<double, 1> cell_count;  // (M,)
  Array<double, 1> edge;        // (M,) px
};

// Adds the cells' shifts to their markers; too large ones become NaN. Returns the largest other one, in
// edges.
double add_shifts(View<const double, 2> xy, View<double, 2> shift, View<const std::int32_t, 2> corners,
                  double max_shift, MarkerSums& sums) {
  double largest = 0.0;
  for (Index i = 0; i < corners.size(); ++i) {
    if (!std::isfinite(shift(i, 0))) continue;
    const auto a = xy[corners(i, 0)], b = xy[corners(i, 1)], c = xy[corners(i, 2)];
    const double size = (distance(a, b) + distance(b, c) + distance(c, a)) / 3;
    const double moved = std::sqrt(shift(i, 0) * shift(i, 0) + shift(i, 1) * shift(i, 1)) / size;
    if (moved > max_shift) {
      shift[i].fill(NOT_A_NUMBER);
      continue;
    }
    largest = std::max(largest, moved);
    for (int k = 0; k < 3; ++k) {
      const std::int32_t m = corners(i, k);
      sums.shift(m, 0) += shift(i, 0);
      sums.shift(m, 1) += shift(i, 1);
      sums.edge[m] += size;
      sums.cell_count[m] += 1.0;
    }
  }
  return largest;
}

}  // namespace

std::array<double, 2> cell_middle(View<const double, 2> xy, View<const std::int32_t, 1> corners) {
  const auto a = xy[corners[0]], b = xy[corners[1]], c = xy[corners[2]];
  return {(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3};
}

Array<double, 2> ink_centroids(View<const std::uint8_t, 3> image, View<const double, 2> xy,
                               const WarmTables& tables, View<const double, 3> levels,
                               const AlignmentLimits& limits) {
  const auto corners = tables.corners, nearest = tables.nearest;
  Array<double, 2> centroid({corners.size(), 2}, NOT_A_NUMBER);
  const auto ink_levels = levels[0], black_levels = levels[1];
  InkWeights ink{{}, 0.0, limits.min_pixel_ink};
  const View<const double, 1> weights(ink.weights.data(), {3});
  for (Index i = 0; i < corners.size(); ++i) {
    const int own = tables.ink[i];
    const std::array<View<const double, 1>, 3> inks{ink_levels[i], ink_levels[nearest(i, own % 3)],
                                                    ink_levels[nearest(i, (own + 1) % 3)]};
    if (!fill_unmixing_weights(inks, limits.min_volume, ink.weights)) continue;
    ink.zero = dot3(weights, black_levels[i]);
    const auto window = search_window(xy, corners[i]);
    if (!(std::abs(window.area) > limits.min_area_px)) continue;
    const auto [sums, row_step] = window_moments(image, window, ink, limits);
    const double least = limits.min_ink_share * CELL_AREA_RATIO * std::abs(window.area);
    if (static_cast<double>(row_step) * sums.area > least) {
      centroid(i, 0) = window.x + sums.x / sums.area;
      centroid(i, 1) = window.y + sums.y / sums.area;
    }
  }
  return centroid;
}

AlignedMarkers update_shifts_and_move_markers(View<const double, 2> xy, View<double, 2> shift,
                                              View<const std::int32_t, 2> corners,
                                              const AlignmentLimits& limits) {
  const Index count = xy.size();
  MarkerSums sums{Array<double, 2>({count, 2}, 0.0), Array<double, 1>({count}, 0.0),
                  Array<double, 1>({count}, 0.0)};
  const double largest = add_shifts(xy, shift, corners, limits.max_shift, sums);
  Array<double, 2> moved({count, 2}, NOT_A_NUMBER);
  for (Index m = 0; m < count; ++m) {
    if (sums.cell_count[m] <= 0.0) continue;
    for (int axis = 0; axis < 2; ++axis)
      moved(m, axis) = xy(m, axis) + sums.shift(m, axis) / sums.cell_count[m];
  }
  for (Index i = 0; i < corners.size(); ++i) {
    if (!std::isfinite(shift(i, 0))) continue;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t m = corners(i, k);
      if (!std::isfinite(moved(m, 0))) continue;
      const double dx = shift(i, 0) - (moved(m, 0) - xy(m, 0)), dy = shift(i, 1) - (moved(m, 1) - xy(m, 1));
      const double limit = limits.max_spread * sums.edge[m] / sums.cell_count[m];
      if (dx * dx + dy * dy > limit * limit) moved[m].fill(NOT_A_NUMBER);
    }
  }
  for (Index m = 0; m < count; ++m) sums.edge[m] /= std::max(sums.cell_count[m], 1.0);
  return {std::move(moved), largest, std::move(sums.edge)};
}

}  // namespace cmp::track
