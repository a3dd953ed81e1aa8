#include "localmap/affine_maps.hpp"

#include <cmath>
#include <limits>

#include "layout/lattice.hpp"

namespace cmp::localmap {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr Index CORNERS = 3;

// x' = xx x + xy y, y' = yx x + yy y.
struct LinearMap {
  double xx, xy, yx, yy;
};

struct Vector {
  double x, y;
};

// The vector from item i to item j of (N, 2).
Vector vector_between(const View<const double, 2>& xy, Index i, Index j) {
  return {xy(j, 0) - xy(i, 0), xy(j, 1) - xy(i, 1)};
}

void fill(const LinearMap& map, View<double, 2> out) {
  out(0, 0) = map.xx;
  out(0, 1) = map.xy;
  out(1, 0) = map.yx;
  out(1, 1) = map.yy;
}

// The linear map around cell i of the image, which is the layout's cell u; see linear_maps.
inline LinearMap map_by_neighbours(Index i, const View<const double, 2>& center_px, Index u,
                                   const View<const std::int32_t, 1>& image_cell,
                                   const layout::LayoutCells& layout, double min_spread) {
  double xx = 0.0, xy = 0.0, yy = 0.0, ax = 0.0, ay = 0.0, bx = 0.0, by = 0.0;
  for (Index k = 0; k < layout::NEIGHBOURS; ++k) {
    const std::int32_t v = layout.cell_neighbours(u, k);
    if (v < 0 || image_cell[v] < 0) continue;
    const Vector mm = vector_between(layout.center_mm, u, v),
                 px = vector_between(center_px, i, image_cell[v]);
    xx += mm.x * mm.x;
    xy += mm.x * mm.y;
    yy += mm.y * mm.y;
    ax += px.x * mm.x;
    ay += px.x * mm.y;
    bx += px.y * mm.x;
    by += px.y * mm.y;
  }
  const double determinant = xx * yy - xy * xy, spread = xx + yy;
  if (!(determinant > min_spread * min_spread * 0.25 * (spread * spread)))
    return {NOWHERE, NOWHERE, NOWHERE, NOWHERE};
  return {(ax * yy - ay * xy) / determinant, (ay * xx - ax * xy) / determinant,
          (bx * yy - by * xy) / determinant, (by * xx - bx * xy) / determinant};
}

// The linear map that carries a cell's corners 0 and 1 onto a triangle of the image.
//
// vectors_mm (3, 2) from the layout cell's center to its corners; corner_px (3, 2) the triangle; center_px
// (2,) its center; first, the triangle's corner that is corner 0; corner_step, corners from one to the next
// of the cell, clockwise in the image: 1 or 2.
LinearMap map_from_triangle(View<const double, 2> vectors_mm, View<const double, 2> corner_px,
                            View<const double, 1> center_px, Index first, Index corner_step) {
  const Index second = (first + corner_step) % CORNERS;
  const Vector a{vectors_mm(0, 0), vectors_mm(0, 1)}, b{vectors_mm(1, 0), vectors_mm(1, 1)};
  const Vector p{corner_px(first, 0) - center_px[0], corner_px(first, 1) - center_px[1]};
  const Vector q{corner_px(second, 0) - center_px[0], corner_px(second, 1) - center_px[1]};
  const double area = a.x * b.y - a.y * b.x;
  return {(p.x * b.y - q.x * a.y) / area, (q.x * a.x - p.x * b.x) / area, (p.y * b.y - q.y * a.y) / area,
          (q.y * a.x - p.y * b.x) / area};
}

// Writes the map of every numbered cell without one that has a triangle and a neighbour to orient it.
void fill_maps_from_triangles(View<const double, 2> center_px, View<const double, 3> corner_px,
                              View<const std::int32_t, 1> cell, View<const std::int32_t, 1> image_cell,
                              Index corner_step, const layout::LayoutCells& layout, View<double, 3> out,
                              const AffineMapLimits& limits) {
  std::array<LinearMap, CORNERS> maps;
  for (Index i = 0; i < cell.size(); ++i) {
    const std::int32_t u = cell[i];
    if (u < 0 || !std::isnan(out(i, 0, 0)) || std::isnan(corner_px(i, 0, 0))) continue;
    for (Index first = 0; first < CORNERS; ++first)
      maps[first] =
          map_from_triangle(layout.corner_vectors_mm[u], corner_px[i], center_px[i], first, corner_step);
    std::array<double, CORNERS> misfit{};  // without a neighbour all are 0
    for (Index k = 0; k < layout::NEIGHBOURS; ++k) {
      const std::int32_t v = layout.cell_neighbours(u, k);
      if (v < 0 || image_cell[v] < 0) continue;
      const Vector mm = vector_between(layout.center_mm, u, v),
                   px = vector_between(center_px, i, image_cell[v]);
      for (Index first = 0; first < CORNERS; ++first) {
        const LinearMap& m = maps[first];
        const double distance =
            std::hypot(px.x - m.xx * mm.x - m.xy * mm.y, px.y - m.yx * mm.x - m.yy * mm.y);
        misfit[first] = std::max(misfit[first], distance / std::hypot(px.x, px.y));
      }
    }
    const Index best = std::min_element(misfit.begin(), misfit.end()) - misfit.begin();
    const double rival = std::min(misfit[(best + 2) % CORNERS], misfit[(best + 1) % CORNERS]);
    if (!(misfit[best] < limits.max_misfit && rival > limits.min_rival_misfit)) continue;
    fill(maps[best], out[i]);
  }
}

}  // namespace

Array<std::int32_t, 1> image_cell_of_layout_cell(View<const std::int32_t, 1> cell, Index count) {
  Array<std::int32_t, 1> out({count}, -1);
  const auto image_cells = out.view();
  for (Index i = 0; i < cell.size(); ++i)
    if (cell[i] >= 0) image_cells[cell[i]] = static_cast<std::int32_t>(i);
  return out;
}

void fill_linear_map(Index i, View<const double, 2> center_px, Index u,
                     View<const std::int32_t, 1> image_cell, const layout::LayoutCells& layout,
                     View<double, 2> out, const AffineMapLimits& limits) {
  fill(map_by_neighbours(i, center_px, u, image_cell, layout, limits.min_spread), out);
}

Array<double, 3> linear_maps(View<const double, 2> center_px, View<const std::int32_t, 1> cell,
                             View<const std::int32_t, 1> image_cell, const layout::LayoutCells& layout,
                             const AffineMapLimits& limits) {
  Array<double, 3> out({cell.size(), 2, 2}, NOWHERE);
  const auto maps = out.view();
  for (Index i = 0; i < cell.size(); ++i)
    if (cell[i] >= 0)
      fill(map_by_neighbours(i, center_px, cell[i], image_cell, layout, limits.min_spread), maps[i]);
  return out;
}

Array<double, 3> completed_linear_maps(View<const double, 2> center_px, View<const double, 3> corner_px,
                                       View<const std::int32_t, 1> cell, bool mirrored,
                                       const layout::LayoutCells& layout, const AffineMapLimits& limits) {
  const auto image_cell = image_cell_of_layout_cell(cell, layout.center_mm.size());
  auto out = linear_maps(center_px, cell, image_cell, layout, limits);
  // clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2
  fill_maps_from_triangles(center_px, corner_px, cell, image_cell, mirrored ? 1 : 2, layout, out, limits);
  return out;
}

}  // namespace cmp::localmap
