#include "numbering/missing_cells.hpp"

#include <vector>

#include "layout/lattice.hpp"

namespace cmp::numbering {

namespace {

constexpr double MIN_SPREAD = 1e-3;  // of the known cells

// The known cells around a cell of the layout: its neighbours, and theirs.
std::vector<std::int32_t> known_around(std::int32_t u, View<const std::int32_t, 1> image_cell,
                                       const layout::LayoutCells& layout, std::int64_t min_neighbours) {
  std::vector<std::int32_t> known;
  std::int64_t near = 0;
  for (Index k = 0; k < layout::NEIGHBOURS; ++k) {
    const std::int32_t v = layout.cell_neighbours(u, k);
    if (v >= 0 && image_cell[v] >= 0) ++near;
  }
  if (near < min_neighbours) return known;
  for (Index k = 0; k < layout::NEIGHBOURS; ++k) {
    const std::int32_t v = layout.cell_neighbours(u, k);
    if (v < 0) continue;
    if (image_cell[v] >= 0) known.push_back(v);
    for (Index j = 0; j < layout::NEIGHBOURS; ++j) {
      const std::int32_t w = layout.cell_neighbours(v, j);
      if (w >= 0 && w != u && image_cell[w] >= 0 && std::find(known.begin(), known.end(), w) == known.end())
        known.push_back(w);
    }
  }
  return known;
}

}  // namespace

std::tuple<Array<std::int32_t, 1>, Array<double, 3>> missing_cells(View<const double, 2> centre,
                                                                   View<const std::int32_t, 1> cell,
                                                                   const layout::LayoutCells& layout,
                                                                   const MissingCellLimits& limits) {
  const Index count = layout.ink.size();
  Array<std::int32_t, 1> image_cell({count}, -1);
  for (Index i = 0; i < cell.size(); ++i)
    if (cell[i] >= 0) image_cell[cell[i]] = static_cast<std::int32_t>(i);
  std::vector<std::int32_t> found;
  std::vector<double> corners;
  for (Index u = 0; u < count; ++u) {
    if (image_cell[u] >= 0) continue;
    const auto known = known_around(static_cast<std::int32_t>(u), image_cell, layout, limits.min_neighbours);
    if (known.empty()) continue;
    const Index first = image_cell[known[0]];
    const double x_mm = layout.centre_mm(known[0], 0), y_mm = layout.centre_mm(known[0], 1);
    localmap::LocalMap<3> map({x_mm, y_mm, layout.size_mm[u], centre(first, 0), centre(first, 1), 1.0});
    for (const std::int32_t v : known)
      map.add(layout.centre_mm(v, 0), layout.centre_mm(v, 1), centre(image_cell[v], 0),
              centre(image_cell[v], 1));
    if (known.size() < 3 || !map.solve(limits.prior.ridge(1.0), MIN_SPREAD)) continue;
    found.push_back(static_cast<std::int32_t>(u));
    for (int k = 0; k < 3; ++k) {
      for (const double place : map.at(layout.centre_mm(u, 0) + layout.corner_vectors_mm(u, k, 0),
                                       layout.centre_mm(u, 1) + layout.corner_vectors_mm(u, k, 1)))
        corners.push_back(place);
    }
  }
  const auto number = static_cast<Index>(found.size());
  return {Array<std::int32_t, 1>(View<const std::int32_t, 1>(found.data(), {number})),
          Array<double, 3>(View<const double, 3>(corners.data(), {number, 3, 2}))};
}

}  // namespace cmp::numbering
