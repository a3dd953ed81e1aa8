#include "cells/cell_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "numeric/delaunay.hpp"
#include "numeric/median.hpp"

namespace cmp::cells {

namespace {

// The column of a value in row i of `rows` (N, 3).
int index_in_row(View<const std::int32_t, 2> rows, Index i, std::int32_t value) {
  return rows(i, 0) == value ? 0 : rows(i, 1) == value ? 1 : 2;
}

// Twice the signed area of the points a, b, c; positive if clockwise, y down.
double doubled_area(View<const double, 2> xy, Index a, Index b, Index c) {
  const double x = xy(a, 0), y = xy(a, 1);
  return (xy(b, 0) - x) * (xy(c, 1) - y) - (xy(b, 1) - y) * (xy(c, 0) - x);
}

// Flips the edge opposite to corner k of face f if it joins cells of one ink and may be flipped.
bool flip_edge(View<const double, 2> points, View<const std::uint8_t, 1> ink, View<std::int32_t, 2> faces,
               View<std::int32_t, 2> neighbours, std::int32_t f, int k) {
  const int next = (k + 1) % 3, last = (k + 2) % 3;
  const std::int32_t g = neighbours(f, k);
  if (g < f) return false;
  const std::int32_t a = faces(f, next), b = faces(f, last), c = faces(f, k);
  const std::int32_t d = faces(g, index_in_row(neighbours, g, f));
  if (ink[a] != ink[b] || ink[c] == ink[d] || ink[c] == ink[a] || ink[d] == ink[a]) return false;
  // the quadrilateral must be convex: both new triangles turn the same way
  if (doubled_area(points, c, a, d) * doubled_area(points, c, d, b) <= 0.0) return false;
  const std::int32_t beyond_bc = neighbours(f, next), beyond_ca = neighbours(f, last);
  const std::int32_t beyond_ad = neighbours(g, index_in_row(faces, g, b));
  const std::int32_t beyond_db = neighbours(g, index_in_row(faces, g, a));
  const auto write = [](View<std::int32_t, 2> rows, Index i, std::array<std::int32_t, 3> values) {
    std::copy(values.begin(), values.end(), rows[i].begin());
  };
  write(faces, f, {c, a, d});
  write(neighbours, f, {beyond_ad, g, beyond_ca});
  write(faces, g, {c, d, b});
  write(neighbours, g, {beyond_db, beyond_bc, f});
  if (beyond_ad >= 0) neighbours(beyond_ad, index_in_row(neighbours, beyond_ad, g)) = f;
  if (beyond_bc >= 0) neighbours(beyond_bc, index_in_row(neighbours, beyond_bc, f)) = g;
  return true;
}

// Whether cells a and b have a common corner; true if one of them has no triangle.
bool has_shared_corner(View<const double, 3> corner, View<const double, 1> area, Index a, Index b,
                       double max_gap) {
  if (std::isnan(corner(a, 0, 0)) || std::isnan(corner(b, 0, 0))) return true;
  const double limit = max_gap * max_gap * std::min(area[a], area[b]) * 4.0 / std::sqrt(3.0);
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double dx = corner(a, i, 0) - corner(b, j, 0), dy = corner(a, i, 1) - corner(b, j, 1);
      nearest = std::min(nearest, dx * dx + dy * dy);
    }
  }
  return nearest < limit;
}

bool has_three_inks(View<const std::uint8_t, 1> ink, Index a, Index b, Index c) {
  return ink[a] != ink[b] && ink[b] != ink[c] && ink[a] != ink[c];
}

// The mesh without its swelling.
struct ClassifiedFaces {
  Array<std::int32_t, 2> faces, neighbours;  // (F, 3), as in CellMesh
  Array<std::int8_t, 1> orientation;         // (F,), as in CellMesh
};

// Flips edges between cells of one ink where the other diagonal joins two other inks.
//
// points (N, 2), ink (N,); faces (F, 3) and neighbours (F, 3) are updated.
void update_flipped_edges(View<const double, 2> points, View<const std::uint8_t, 1> ink,
                          View<std::int32_t, 2> faces, View<std::int32_t, 2> neighbours,
                          const CellMeshLimits& limits) {
  for (std::int64_t round = 0; round < limits.max_flip_rounds; ++round) {
    Index flips = 0;
    for (std::int32_t f = 0; f < faces.size(); ++f) {
      for (int k = 0; k < 3; ++k) {
        if (!flip_edge(points, ink, faces, neighbours, f, k)) continue;
        ++flips;
        break;
      }
    }
    if (flips == 0) break;
  }
}

// Corners as red, green, blue; only triangles that are markers or black cells.
//
// points (N, 2), ink (N,), area (N,), corner (N, 3, 2) of the cells; faces (F, 3), neighbours (F, 3).
ClassifiedFaces classify_faces(View<const double, 2> points, View<const std::uint8_t, 1> ink,
                               View<const double, 1> area, View<const double, 3> corner,
                               View<const std::int32_t, 2> faces, View<const std::int32_t, 2> neighbours,
                               const CellMeshLimits& limits) {
  const Index count = faces.size();
  Array<std::int32_t, 2> ordered({count, 3}, -1), across({count, 3}, -1);
  Array<std::int8_t, 1> orientation({count}, 0);
  for (Index f = 0; f < count; ++f) {
    const std::int32_t a = faces(f, 0), b = faces(f, 1), c = faces(f, 2);
    if (!has_three_inks(ink, a, b, c)) continue;
    const double size = 0.5 * std::abs(doubled_area(points, a, b, c));
    const double mean = (area[a] + area[b] + area[c]) / 3.0;
    if (size < limits.min_area_ratio * mean || size > limits.max_area_ratio * mean) continue;
    const double gap = limits.max_corner_gap;
    if (!has_shared_corner(corner, area, a, b, gap) || !has_shared_corner(corner, area, b, c, gap) ||
        !has_shared_corner(corner, area, c, a, gap))
      continue;
    for (int k = 0; k < 3; ++k) {
      const int column = ink[faces(f, k)] - 1;
      ordered(f, column) = faces(f, k);
      across(f, column) = neighbours(f, k);
    }
    const bool is_clockwise = doubled_area(points, ordered(f, 0), ordered(f, 1), ordered(f, 2)) > 0.0;
    orientation[f] = is_clockwise ? 1 : -1;
  }
  for (Index f = 0; f < count; ++f) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t g = across(f, k);
      if (g >= 0 && orientation[g] != -orientation[f]) across(f, k) = -1;
    }
  }
  return {std::move(ordered), std::move(across), std::move(orientation)};
}

// Sides of the cells' triangles over those at which neighbours just meet; there a face is as large as the
// triangles of its cells.
//
// points (N, 2), ink (N,), corner (N, 3, 2) of the cells; faces (F, 3).
double swelling_of(View<const double, 2> points, View<const std::uint8_t, 1> ink,
                   View<const double, 3> corner, View<const std::int32_t, 2> faces,
                   const CellMeshLimits& limits) {
  Array<double, 1> ratio({faces.size()});
  Index count = 0;
  for (Index f = 0; f < faces.size(); ++f) {
    const std::int32_t a = faces(f, 0), b = faces(f, 1), c = faces(f, 2);
    if (!has_three_inks(ink, a, b, c)) continue;
    const double size = std::abs(doubled_area(points, a, b, c));
    double total = 0.0;
    for (const Index i : {a, b, c}) total += std::abs(doubled_area(corner[i], 0, 1, 2));
    if (size > 0.0 && std::isfinite(total)) ratio[count++] = total / (3.0 * size);
  }
  if (count == 0) return 1.0;
  const double root = std::sqrt(numeric::median_of_many(ratio.slice(0, count)));
  return std::min(std::max(root, 1.0), limits.max_swelling);
}

}  // namespace

CellMesh build_cell_mesh(const MeshedCells& cells, const CellMeshLimits& limits) {
  const auto center = cells.center_px;
  auto [faces, neighbours] = numeric::triangulate(center);
  update_flipped_edges(center, cells.ink, faces, neighbours, limits);
  const double swelling = swelling_of(center, cells.ink, cells.corner_px, faces, limits);
  const Array<double, 3> corner = without_swelling(center, cells.corner_px, swelling);
  ClassifiedFaces found = classify_faces(center, cells.ink, cells.area_px, corner, faces, neighbours, limits);
  const std::int64_t count = std::count_if(found.orientation.begin(), found.orientation.end(),
                                           [](std::int8_t turn) { return turn != 0; });
  return {std::move(found.faces), std::move(found.neighbours), std::move(found.orientation), swelling, count};
}

Array<double, 3> without_swelling(View<const double, 2> center, View<const double, 3> corner,
                                  double swelling) {
  Array<double, 3> out(corner.shape());
  const auto moved = out.view();
  for (Index i = 0; i < center.size(); ++i) {
    const double x = center(i, 0), y = center(i, 1);
    for (int k = 0; k < 3; ++k) {
      moved(i, k, 0) = x + (corner(i, k, 0) - x) / swelling;
      moved(i, k, 1) = y + (corner(i, k, 1) - y) / swelling;
    }
  }
  return out;
}

}  // namespace cmp::cells
