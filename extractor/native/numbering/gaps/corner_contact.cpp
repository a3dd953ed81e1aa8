#include "numbering/gaps/corner_contact.hpp"

#include <bit>

#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

namespace {

constexpr Index NEIGHBOURS = 6, CORNERS = 3;
constexpr Index NEAREST = 2;  // cells of the image that may lie where a neighbour is predicted
// A cell and its neighbour along NEIGHBOUR_STEPS share this corner of the cell, and this one of the
// neighbour.
constexpr std::array<Index, NEIGHBOURS> OWN_CORNER{1, 2, 2, 0, 0, 1}, NEIGHBOUR_CORNER{0, 0, 1, 1, 2, 2};

double squared(double value) { return value * value; }

// A corner's number from a number less than 9.
inline Index turned_corner(Index number) {
  constexpr std::array<Index, 3 * CORNERS> TURNED{0, 1, 2, 0, 1, 2, 0, 1, 2};
  return TURNED[number];
}

// A linear map, px per mm.
using LinearMap = std::array<double, 4>;  // row by row

void fill(View<double, 2> out, const LinearMap& map) {
  out(0, 0) = map[0];
  out(0, 1) = map[1];
  out(1, 0) = map[2];
  out(1, 1) = map[3];
}

// The map that carries the corners of a cell of the layout onto a triangle of the image.
inline LinearMap triangle_map(const ImageTriangle& image, const LayoutTriangle& layout,
                              std::int64_t first_corner, Index corner_step) {
  const Index after = turned_corner(first_corner + corner_step);
  const double px = image.corner_x[first_corner] - image.x, qx = image.corner_x[after] - image.x;
  const double py = image.corner_y[first_corner] - image.y, qy = image.corner_y[after] - image.y;
  LinearMap map{px * layout.by - qx * layout.ay, qx * layout.ax - px * layout.bx,
                py * layout.by - qy * layout.ay, qy * layout.ax - py * layout.bx};
  for (double& entry : map) entry /= layout.area;
  return map;
}

// Whether the triangle of cell i, as the layout's u, predicts the layout's v near cell j.
inline bool is_neighbour_predicted(const Contacts& contacts, std::array<Index, 2> ij, std::array<Index, 2> uv,
                                   std::int64_t first_corner) {
  const ImageTriangle &own = contacts.image_triangles[ij[0]], &other = contacts.image_triangles[ij[1]];
  const LayoutTriangle &u = contacts.layout_triangles[uv[0]], &v = contacts.layout_triangles[uv[1]];
  const LinearMap map = triangle_map(own, u, first_corner, contacts.corner_step);
  const double x = other.x - own.x, y = other.y - own.y, x_mm = v.x - u.x, y_mm = v.y - u.y;
  const double dx = map[0] * x_mm + map[1] * y_mm - x, dy = map[2] * x_mm + map[3] * y_mm - y;
  return dx * dx + dy * dy < squared(contacts.limits.max_predicted_distance) * (x * x + y * y);
}

// The first corner of a triangle whose corner `at` is the layout's corner `number`.
inline std::int64_t first_corner_of(Index at, Index number, Index corner_step) {
  return turned_corner(at + 2 * CORNERS - corner_step * number);
}

// Whether cells i and j, as the layout's u and its neighbour in direction k, share the right corner.
inline bool has_shared_corner(const Contacts& contacts, Index i, Index j, Index u, Index k) {
  const ImageTriangle &own = contacts.image_triangles[i], &other = contacts.image_triangles[j];
  const Index v = contacts.layout.cell_neighbours(u, k), step = contacts.corner_step;
  const double edge = std::min(own.edge, other.edge);
  if (std::isnan(own.corner_x[0]) || std::isnan(other.corner_x[0])) {
    const double x = other.x - own.x, y = other.y - own.y;
    return x * x + y * y < squared(contacts.limits.max_neighbour_distance * edge);
  }
  const double limit = squared(contacts.limits.max_corner_distance * edge);
  unsigned close = 0;  // pairs of corners; branches would be unpredictable
  for (Index a = 0; a < CORNERS; ++a) {
    for (Index b = 0; b < CORNERS; ++b) {
      const double x = other.corner_x[b] - own.corner_x[a], y = other.corner_y[b] - own.corner_y[a];
      close |= static_cast<unsigned>(x * x + y * y < limit) << (CORNERS * a + b);
    }
  }
  for (; close != 0; close &= close - 1) {
    const Index pair = std::countr_zero(close), a = pair / CORNERS, b = pair % CORNERS;
    if (is_neighbour_predicted(contacts, {i, j}, {u, v}, first_corner_of(a, OWN_CORNER[k], step)) &&
        is_neighbour_predicted(contacts, {j, i}, {v, u}, first_corner_of(b, NEIGHBOUR_CORNER[k], step)))
      return true;
  }
  return false;
}

// Whether a neighbour of the layout's cell u is free.
bool has_free_neighbour(const layout::LayoutCells& layout, Index u, View<const bool, 1> free) {
  for (Index k = 0; k < NEIGHBOURS; ++k) {
    const Index v = layout.cell_neighbours(u, k);
    if (v >= 0 && free[v]) return true;
  }
  return false;
}

// The first corner of cell j as the layout's neighbour of u in direction k; UNKNOWN_CORNER without the right
// contact.
//
// Cell i is the layout's u, counted from first_corner.
std::int64_t first_corner_by_contact(const Contacts& contacts, std::array<Index, 2> ij, Index u, Index k,
                                     std::int64_t first_corner) {
  const auto [i, j] = ij;
  const ImageTriangle &own = contacts.image_triangles[i], &other = contacts.image_triangles[j];
  const Index v = contacts.layout.cell_neighbours(u, k);
  const Index at = turned_corner(first_corner + contacts.corner_step * OWN_CORNER[k]);
  const double limit = squared(contacts.limits.max_corner_distance * std::min(own.edge, other.edge));
  for (Index c = 0; c < CORNERS; ++c) {
    const double x = other.corner_x[c] - own.corner_x[at], y = other.corner_y[c] - own.corner_y[at];
    if (!(x * x + y * y <= limit)) continue;
    const std::int64_t turned = first_corner_of(c, NEIGHBOUR_CORNER[k], contacts.corner_step);
    if (is_neighbour_predicted(contacts, {j, i}, {v, u}, turned)) return turned;
  }
  return UNKNOWN_CORNER;
}

// The cells without a number, and a grid of their centers.
struct UnnumberedCells {
  View<const std::int64_t, 1> cells;  // (K,)
  const numeric::BucketGrid& grid;
};

// Numbers the cell of the image that is the free neighbour of cell i in direction k, if it is in contact; -1
// without one.
Index number_neighbour(const Contacts& contacts, Index i, Index k, const UnnumberedCells& unnumbered,
                       PartialNumbering& numbering) {
  const auto &center = contacts.cells.center_px, &center_mm = contacts.layout.center_mm;
  const auto cell = numbering.cell.view();
  const auto maps = numbering.maps.view();
  const Index u = cell[i], v = contacts.layout.cell_neighbours(u, k);
  if (v < 0 || !numbering.free[v]) return -1;
  const double x = center_mm(v, 0) - center_mm(u, 0), y = center_mm(v, 1) - center_mm(u, 1);
  const double px = center(i, 0) + maps(i, 0, 0) * x + maps(i, 0, 1) * y;
  const double py = center(i, 1) + maps(i, 1, 0) * x + maps(i, 1, 1) * y;
  std::array<std::int32_t, NEAREST> index;
  std::array<double, NEAREST> square;
  const Index found = numeric::fill_nearest_points(unnumbered.grid, px, py, {index.data(), {NEAREST}},
                                                   {square.data(), {NEAREST}});
  for (Index n = 0; n < found; ++n) {
    const Index j = unnumbered.cells[index[n]];
    if (cell[j] >= 0 || contacts.cells.ink[j] != contacts.layout.ink[v]) continue;
    const double distance2 = squared(center(j, 0) - center(i, 0)) + squared(center(j, 1) - center(i, 1));
    if (square[n] > squared(contacts.limits.max_predicted_distance) * distance2) continue;
    const std::int64_t turned = first_corner_by_contact(contacts, {i, j}, u, k, numbering.first_corner[i]);
    if (turned < 0) continue;
    cell[j] = static_cast<std::int32_t>(v);
    numbering.free[v] = false;
    numbering.first_corner[j] = turned;
    fill(maps[j], triangle_map(contacts.image_triangles[j], contacts.layout_triangles[v], turned,
                               contacts.corner_step));
    return j;
  }
  return -1;
}

}  // namespace

Contacts::Contacts(const cells::CellArrays& all_cells, const layout::LayoutCells& all_places, Index step,
                   const CornerContactLimits& contact_limits)
    : cells(all_cells),
      layout(all_places),
      corner_step(step),
      limits(contact_limits),
      image_triangles({all_cells.center_px.size()}),
      layout_triangles({all_places.center_mm.size()}) {
  const auto center = cells.center_px, center_mm = layout.center_mm;
  const auto corner = cells.corner_px, vectors = layout.corner_vectors_mm;
  for (Index i = 0; i < center.size(); ++i)
    image_triangles[i] = {center(i, 0),
                          center(i, 1),
                          {corner(i, 0, 0), corner(i, 1, 0), corner(i, 2, 0)},
                          {corner(i, 0, 1), corner(i, 1, 1), corner(i, 2, 1)},
                          equilateral_edge(cells.area_px[i])};
  for (Index u = 0; u < center_mm.size(); ++u) {
    const double ax = vectors(u, 0, 0), ay = vectors(u, 0, 1), bx = vectors(u, 1, 0), by = vectors(u, 1, 1);
    layout_triangles[u] = {center_mm(u, 0), center_mm(u, 1), ax, ay, bx, by, ax * by - ay * bx};
  }
}

Array<double, 2> selected_points(View<const double, 2> points, View<const std::int64_t, 1> numbers) {
  Array<double, 2> out({numbers.size(), 2});
  const auto rows = out.view();
  for (Index k = 0; k < numbers.size(); ++k) {
    rows(k, 0) = points(numbers[k], 0);
    rows(k, 1) = points(numbers[k], 1);
  }
  return out;
}

Array<std::int64_t, 1> numbers_of(View<const bool, 1> selected) {
  Array<std::int64_t, 1> out({std::count(selected.begin(), selected.end(), true)});
  Index count = 0;
  for (Index i = 0; i < selected.size(); ++i) {
    if (selected[i]) out[count++] = i;
  }
  return out;
}

PartialNumbering begin_numbering(View<const std::int32_t, 1> cell, View<const bool, 1> free) {
  return {Array<std::int32_t, 1>(cell), Array<bool, 1>(free),
          Array<std::int64_t, 1>({cell.size()}, NOT_EVALUATED), Array<double, 3>({cell.size(), 2, 2}),
          localmap::image_cell_of_layout_cell(cell, free.size())};
}

Array<std::int32_t, 2> corner_neighbours(const Contacts& contacts, View<const std::int32_t, 1> cell) {
  Array<std::int32_t, 2> out({cell.size(), NEIGHBOURS}, -1);
  update_corner_neighbours(Array<bool, 1>({cell.size()}, true), contacts, cell, out);
  return out;
}

void update_corner_neighbours(View<const bool, 1> is_new, const Contacts& contacts,
                              View<const std::int32_t, 1> cell, View<std::int32_t, 2> out) {
  const auto& is_intact = contacts.cells.is_intact;
  const Array<std::int32_t, 1> image_cell =
      localmap::image_cell_of_layout_cell(cell, contacts.layout.ink.size());
  for (Index i = 0; i < cell.size(); ++i) {
    if (cell[i] < 0 || !is_intact[i]) continue;
    for (Index k = 0; k < NEIGHBOURS / 2; ++k) {  // the other directions are those of the other cell
      const std::int32_t v = contacts.layout.cell_neighbours(cell[i], k);
      if (v < 0 || image_cell[v] < 0 || !is_intact[image_cell[v]]) continue;
      const std::int32_t j = image_cell[v];
      if ((is_new[i] || is_new[j]) && has_shared_corner(contacts, i, j, cell[i], k)) {
        out(i, k) = j;
        out(j, k + NEIGHBOURS / 2) = static_cast<std::int32_t>(i);
      }
    }
  }
}

std::int64_t fill_map_by_similarity(const Contacts& contacts, Index i, Index u, View<const double, 2> wanted,
                                    View<double, 2> out) {
  if (std::isnan(contacts.cells.corner_px(i, 0, 0)) || std::isnan(wanted(0, 0))) return UNKNOWN_CORNER;
  const double w0 = wanted(0, 0), w1 = wanted(0, 1), w2 = wanted(1, 0), w3 = wanted(1, 1);
  double best = contacts.limits.max_map_difference * std::sqrt(w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3);
  std::int64_t found = UNKNOWN_CORNER;
  for (std::int64_t first_corner = 0; first_corner < CORNERS; ++first_corner) {
    const LinearMap map = triangle_map(contacts.image_triangles[i], contacts.layout_triangles[u],
                                       first_corner, contacts.corner_step);
    const double difference =
        std::sqrt(squared(map[0] - w0) + squared(map[1] - w1) + squared(map[2] - w2) + squared(map[3] - w3));
    if (difference < best) {
      best = difference;
      found = first_corner;
      fill(out, map);
    }
  }
  return found;
}

Array<std::int64_t, 1> update_numbers_by_contact(const Contacts& contacts,
                                                 View<const std::int64_t, 1> unnumbered,
                                                 View<const std::int64_t, 1> start,
                                                 PartialNumbering& numbering) {
  Array<std::int64_t, 1> queue({start.size() + unnumbered.size()});
  Index end = 0;
  if (unnumbered.size() > 0) {
    for (const Index i : start) {
      if (!has_free_neighbour(contacts.layout, numbering.cell[i], numbering.free.view())) continue;
      if (update_first_corner(contacts, i, numbering) >= 0) queue[end++] = i;
    }
  }
  const Index first = end;
  if (end == 0) return queue.first(0);
  const Array<double, 2> points = selected_points(contacts.cells.center_px, unnumbered);
  const numeric::BucketGrid grid = numeric::bucket_grid(points);
  for (Index begin = 0; begin < end; ++begin) {
    for (Index k = 0; k < NEIGHBOURS; ++k) {
      const Index j = number_neighbour(contacts, queue[begin], k, {unnumbered, grid}, numbering);
      if (j >= 0) queue[end++] = j;
    }
  }
  return Array<std::int64_t, 1>(queue.slice(first, end));
}

std::int64_t update_first_corner(const Contacts& contacts, Index i, PartialNumbering& numbering) {
  if (numbering.first_corner[i] == NOT_EVALUATED) {
    const Index u = numbering.cell[i];
    const auto map = numbering.maps.view()[i];
    localmap::fill_linear_map(i, contacts.cells.center_px, u, numbering.image_cell, contacts.layout, map,
                              contacts.limits.maps);
    numbering.first_corner[i] = fill_map_by_similarity(contacts, i, u, map, map);
  }
  return numbering.first_corner[i];
}

}  // namespace cmp::numbering
