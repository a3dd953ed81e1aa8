#include "cells/triangle_edges.hpp"

#include <cmath>
#include <vector>

#include "cells/edge_profiles.hpp"

namespace cmp::cells {

namespace {

using Indices = View<const Index, 1>;

// Writes the ends, centres and sizes: the first edge of each cell, then the second, then the third.
void fill_edges(View<const double, 3> corners, Indices cells, View<double, 1> edges) {
  const Index count = cells.size();
  for (Index n = 0; n < count; ++n) {
    const auto corner = corners[cells[n]];
    const double x = (corner(0, 0) + corner(1, 0) + corner(2, 0)) / 3;
    const double y = (corner(0, 1) + corner(1, 1) + corner(2, 1)) / 3;
    const double dx = corner(0, 0) - x, dy = corner(0, 1) - y;
    const double size = std::sqrt(dx * dx + dy * dy);
    for (Index k = 0; k < 3; ++k) {
      const Index to = k * count + n, end = (k + 1) % 3;
      edges[START_X + to] = corner(k, 0), edges[START_Y + to] = corner(k, 1);
      edges[END_X + to] = corner(end, 0), edges[END_Y + to] = corner(end, 1);
      edges[CENTRE_X + to] = x, edges[CENTRE_Y + to] = y;
      edges[SIZE + to] = size;
    }
  }
}

// Writes the outward normals, the distances and the middles of the edges, relative to the centres.
void fill_normals(View<double, 1> edges, Index count) {
  for (Index i = 0; i < count; ++i) {
    const double x = edges[START_X + i], y = edges[START_Y + i];
    const double cx = edges[CENTRE_X + i], cy = edges[CENTRE_Y + i];
    const double dx = edges[END_X + i] - x, dy = edges[END_Y + i] - y;
    const double length = std::sqrt(dx * dx + dy * dy);
    const double nx = dy / length, ny = -dx / length;  // outward: corners run clockwise with y down
    edges[NORMAL_X + i] = nx, edges[NORMAL_Y + i] = ny;
    edges[DEPTH + i] = (x - cx) * nx + (y - cy) * ny;
    edges[MEDIAN_X + i] = x + 0.5 * dx - cx, edges[MEDIAN_Y + i] = y + 0.5 * dy - cy;
  }
}

// Writes the lines through the two positions of each edge at which the ink falls to half.
void fill_edge_lines(View<double, 1> edges, Index count, const TriangleEdgeLimits& limits) {
  const auto half = static_cast<double>(limits.half_profile);
  const double first_profile = limits.first_profile, between = 1.0 - 2 * limits.first_profile;
  const double reach = limits.profile_reach, step = reach / half;
  for (Index i = 0; i < count; ++i) {
    const double depth = edges[DEPTH + i];
    const double first = depth * (edges[AREA_BEFORE + i] * step - reach);
    const double second = depth * (edges[AREA + i] * step - reach);
    const double slope = (second - first) / between;
    const double off_a = first - first_profile * slope, off_b = second + first_profile * slope;
    const double nx = edges[NORMAL_X + i], ny = edges[NORMAL_Y + i];
    const double ax = edges[START_X + i] + off_a * nx, ay = edges[START_Y + i] + off_a * ny;
    const double dx = edges[END_X + i] + off_b * nx - ax, dy = edges[END_Y + i] + off_b * ny - ay;
    const double norm = std::sqrt(dx * dx + dy * dy);
    const double line_x = dy / norm, line_y = -dx / norm;
    edges[LINE_X + i] = line_x, edges[LINE_Y + i] = line_y;
    edges[LINE_D + i] = line_x * ax + line_y * ay;
  }
}

// Writes the intersections `moved` (3, 2) of the lines of cell n of `count` cells.
//
// Returns false if two lines are parallel or a corner moves by max_shift px or more.
bool fill_line_intersections(View<const double, 1> edges, Index n, Index count, double max_shift,
                             double min_sine, View<double, 2> moved) {
  for (Index k = 0; k < 3; ++k) {
    const Index here = k * count + n, before = (k + 2) % 3 * count + n;
    const double ax = edges[LINE_X + before], ay = edges[LINE_Y + before], a = edges[LINE_D + before];
    const double bx = edges[LINE_X + here], by = edges[LINE_Y + here], b = edges[LINE_D + here];
    const double sine = ax * by - ay * bx;
    if (!(std::abs(sine) >= min_sine)) return false;
    moved(k, 0) = (a * by - ay * b) / sine;
    moved(k, 1) = (ax * b - a * bx) / sine;
    const double dx = moved(k, 0) - edges[START_X + here], dy = moved(k, 1) - edges[START_Y + here];
    if (!(dx * dx + dy * dy < max_shift * max_shift)) return false;
  }
  return true;
}

// Moves the cells' corners to the lines' intersections; adds the cells to `moving` that moved far.
void update_corners(View<const double, 1> edges, Indices cells, View<double, 3> corners, View<bool, 1> good,
                    std::vector<Index>& moving, const TriangleEdgeLimits& limits) {
  const Index count = cells.size();
  std::array<double, 6> corner_memory{};
  const View<double, 2> moved(corner_memory.data(), {3, 2});
  for (Index n = 0; n < count; ++n) {
    const Index i = cells[n];
    const bool is_valid = edges[VALID + n] * edges[VALID + count + n] * edges[VALID + 2 * count + n] > 0.0;
    good[i] = is_valid && fill_line_intersections(edges, n, count, limits.max_corner_shift * edges[SIZE + n],
                                                  limits.min_sine, moved);
    if (!good[i]) continue;
    double most2 = 0.0;
    for (Index k = 0; k < 3; ++k) {
      const double dx = moved(k, 0) - corners(i, k, 0), dy = moved(k, 1) - corners(i, k, 1);
      most2 = std::max(most2, dx * dx + dy * dy);
    }
    copy<double, 2>(moved, corners[i]);
    const double settled = limits.settled_shift * edges[SIZE + n];
    if (most2 > settled * settled) moving.push_back(i);
  }
}

}  // namespace

void update_triangle_corners(const image::PyramidLevel& view, View<double, 3> corners, View<bool, 1> good,
                             const TriangleEdgeLimits& limits) {
  const ProfileImage image{view.image.flat(), view.response.light, view.image.size(0), view.image.size(1)};
  Array<double, 1> edge_table({COLUMNS * numeric::BATCH_POINTS}, 0.0);
  const auto edges = edge_table.view();
  auto buffers = numeric::allocate_sample_buffers();
  std::vector<Index> moving;
  for (Index i = 0; i < good.size(); ++i)
    if (good[i]) moving.push_back(i);
  for (std::int64_t pass = 0; pass < limits.max_passes; ++pass) {
    const std::vector<Index> measured(std::move(moving));
    moving.clear();
    const Indices all(measured.data(), {static_cast<Index>(measured.size())});
    for (Index begin = 0; begin < all.size(); begin += BATCH_CELLS) {
      const auto cells = all.slice(begin, std::min(begin + BATCH_CELLS, all.size()));
      const Index count = 3 * cells.size();
      fill_edges(corners, cells, edges);
      fill_normals(edges, count);
      fill_contrast_weights(image, edges, count, buffers, limits);
      fill_profile_places(image, edges, count, limits);
      fill_profile_areas(image, false, edges, count, buffers, limits);
      fill_profile_areas(image, true, edges, count, buffers, limits);
      fill_edge_lines(edges, count, limits);
      update_corners(edges, cells, corners, good, moving, limits);
    }
  }
}

}  // namespace cmp::cells
