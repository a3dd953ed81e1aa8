#include "cells/cells.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "numeric/median.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::cells {

namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr Index BUCKET_REACH = 2;  // the buckets on each side in which cells are counted

// Cells in the order of their bucket grid, so that the cells of a row of buckets follow each other.
struct OrderedCells {
  Array<double, 1> x, y;   // (N,) the centers, px
  Array<double, 1> limit;  // (N,) share of the area: a cell below the limit is much smaller
};

// Squared distances of the cells around one cell.
struct DistanceBuffers {
  Array<double, 1> every;   // (N,) px^2
  Array<double, 1> larger;  // (N,) the same for much larger cells, infinite for the others
};

// The items of the first dimension with these indices, in their order.
template <class T, int N>
Array<T, N> picked(Array<T, N>&& from, const std::vector<Index>& indices) {
  auto shape = from.shape();
  const Index length = from.count() / std::max<Index>(shape[0], 1);
  shape[0] = static_cast<Index>(indices.size());
  Array<T, N> out(shape);
  const auto items = from.flat(), kept = out.flat();
  Index to = 0;
  for (const Index i : indices) {
    for (Index k = 0; k < length; ++k) kept[to + k] = items[i * length + k];
    to += length;
  }
  return out;
}

OrderedCells ordered_cells(View<const std::int32_t, 1> order, View<const double, 2> center,
                           View<const double, 1> area, double share) {
  const Index count = order.size();
  OrderedCells out{Array<double, 1>({count}), Array<double, 1>({count}), Array<double, 1>({count})};
  for (Index k = 0; k < count; ++k) {
    const std::int32_t i = order[k];
    out.x[k] = center(i, 0);
    out.y[k] = center(i, 1);
    out.limit[k] = share * area[i];
  }
  return out;
}

// Writes the squared distances of the cells in the 5 by 5 buckets around (x, y).
//
// All cells within the largest of the radii are among them. Returns how many cells these are.
Index fill_squared_distances(const numeric::BucketGrid& grid, const OrderedCells& ordered, double x, double y,
                             double area, DistanceBuffers& distances) {
  const Index columns = grid.columns, rows = (grid.begin.size() - 1) / columns;
  const auto column = static_cast<Index>((x - grid.low_x) / grid.step);
  const auto row = static_cast<Index>((y - grid.low_y) / grid.step);
  const Index left = std::max<Index>(column - BUCKET_REACH, 0);
  const Index right = std::min(column + BUCKET_REACH, columns - 1);
  Index count = 0;
  for (Index line = std::max<Index>(row - BUCKET_REACH, 0); line <= std::min(row + BUCKET_REACH, rows - 1);
       ++line) {
    const Index first = grid.begin[line * columns + left];
    const Index more = grid.begin[line * columns + right + 1] - first;
    const auto xs = ordered.x.view(), ys = ordered.y.view(), limits = ordered.limit.view();
    const auto every = distances.every.view(), larger = distances.larger.view();
    for (Index k = 0; k < more; ++k) {
      const double dx = xs[first + k] - x, dy = ys[first + k] - y;
      const double square = dx * dx + dy * dy;
      every[count + k] = square;
      larger[count + k] = limits[first + k] > area ? square : INFINITE;
    }
    count += more;
  }
  return count;
}

// A bound for the number of much larger cells among the nearest ones, if counting within a few radii finds
// it.
//
// The bound suffices to compare the number with max_larger. Counting takes a third of the time of finding the
// nearest cells.
std::optional<Index> larger_neighbour_count(const DistanceBuffers& distances, Index count, double step,
                                            Index max_larger, const CellLimits& limits) {
  const auto every = distances.every.view(), much_larger = distances.larger.view();
  const Index nearest = limits.nearest_cells;
  for (const double radius : limits.count_radii) {
    const double reach = (radius * step) * (radius * step);
    Index within = 0, larger = 0;
    for (Index k = 0; k < count; ++k) {
      within += every[k] <= reach;
      larger += much_larger[k] <= reach;
    }
    if (within <= nearest && larger >= max_larger) return larger;  // all these are among the nearest
    if (within < nearest) break;
    if (larger < max_larger || within == nearest) return larger;  // the nearest are all among these
  }
  return std::nullopt;
}

// The cells of which a share of the area of some others exceeds their own area, by so many that a search is
// needed.
std::vector<Index> small_cells(View<const double, 1> area, double share, Index max_larger) {
  Array<double, 1> sorted(area);
  const Index last =
      area.size() - max_larger;  // cells for which fewer are larger in the whole image need none
  const double limit = share * numeric::select(sorted, last);
  std::vector<Index> small;
  for (Index i = 0; i < area.size(); ++i)
    if (area[i] < limit) small.push_back(i);
  return small;
}

// (N,) the cells with fewer than max_larger much larger ones among their nearest.
//
// A cell is much larger when `share` of its area exceeds the area of the cell in question.
Array<bool, 1> has_few_larger_neighbours(View<const double, 2> center, View<const double, 1> area,
                                         double share, Index max_larger, const CellLimits& limits) {
  const Index count = area.size(), nearest = limits.nearest_cells;
  Array<bool, 1> few({count}, true);
  if (count <= nearest) return few;
  const auto [least, most] = std::minmax_element(area.begin(), area.end());
  if (*least >= share * *most) return few;
  const auto small = small_cells(area, share, max_larger);
  if (small.empty()) return few;
  const auto grid = numeric::bucket_grid(center);
  const auto ordered = ordered_cells(grid.order, center, area, share);
  DistanceBuffers distances{Array<double, 1>({count}), Array<double, 1>({count})};
  Array<std::int32_t, 1> index({nearest});
  Array<double, 1> square({nearest});
  for (const Index i : small) {
    const double x = center(i, 0), y = center(i, 1);
    const Index found = fill_squared_distances(grid, ordered, x, y, area[i], distances);
    auto larger = larger_neighbour_count(distances, found, grid.step, max_larger, limits);
    if (!larger) {
      numeric::fill_nearest_points(grid, x, y, index, square);
      larger = std::count_if(index.begin(), index.end(),
                             [&](std::int32_t j) { return area[i] < share * area[j]; });
    }
    few[i] = *larger < max_larger;
  }
  return few;
}

// Replaces arrays of cells by those of some of the cells.
void keep_only(const std::vector<Index>& cells, Array<double, 2>& center, Array<std::uint8_t, 1>& ink,
               Array<double, 1>& area, Array<double, 3>& corners) {
  center = picked(std::move(center), cells);
  ink = picked(std::move(ink), cells);
  area = picked(std::move(area), cells);
  corners = picked(std::move(corners), cells);
}

}  // namespace

FoundCells cell_arrays(View<const double, 2> seed_center, View<const std::uint8_t, 1> ink,
                       View<const std::int64_t, 1> area_px, View<const std::int32_t, 1> region,
                       View<const double, 3> corner_px, Index scale, bool cluttered,
                       const CellLimits& limits) {
  const auto times = static_cast<double>(scale);
  const Index domains = seed_center.size();
  Array<double, 2> center({domains, 2});
  Array<double, 1> area({domains});
  for (Index i = 0; i < domains; ++i) {
    for (int axis = 0; axis < 2; ++axis) center(i, axis) = (seed_center(i, axis) + 0.5) * times - 0.5;
    area[i] = static_cast<double>(area_px[i]);
  }
  Array<double, 3> corners({domains, 3, 2}, std::numeric_limits<double>::quiet_NaN());
  for (Index t = 0; t < region.size(); ++t) {
    const auto from = corner_px[t];
    const auto to = corners[region[t]];
    for (int axis = 0; axis < 2; ++axis) {
      for (int k = 0; k < 3; ++k) to(k, axis) = from(k, axis);
      center(region[t], axis) = (from(0, axis) + from(1, axis) + from(2, axis)) / 3;
    }
  }
  Array<std::uint8_t, 1> inks(ink);
  if (cluttered) keep_only({region.begin(), region.end()}, center, inks, area, corners);
  const auto is_large =
      has_few_larger_neighbours(center, area, limits.min_area_share, limits.max_larger_than_cell, limits);
  std::vector<Index> large;
  for (Index i = 0; i < is_large.size(); ++i)
    if (is_large[i]) large.push_back(i);
  if (static_cast<Index>(large.size()) < is_large.size()) keep_only(large, center, inks, area, corners);
  for (double& value : area) value = value * times * times;
  return {std::move(center), std::move(inks), std::move(area), std::move(corners)};
}

double equilateral_edge(View<const double, 1> area) {
  if (area.size() == 0) return 0.0;
  Array<double, 1> values(area);
  return std::sqrt(numeric::median_of_many(values) * 4.0 / std::sqrt(3.0));
}

Array<bool, 1> is_intact(View<const double, 2> center, View<const double, 1> area,
                         View<const double, 3> corner, const CellLimits& limits) {
  const Index count = area.size();
  Index triangles = 0;
  for (Index i = 0; i < count; ++i) triangles += std::isfinite(corner(i, 0, 0));
  const bool most_are_triangles =
      !(static_cast<double>(triangles) < limits.min_triangle_share * static_cast<double>(count));
  auto intact =
      has_few_larger_neighbours(center, area, limits.min_intact_share, limits.max_larger_than_intact, limits);
  for (Index i = 0; i < count; ++i)
    intact[i] = intact[i] && (!most_are_triangles || std::isfinite(corner(i, 0, 0)));
  return intact;
}

}  // namespace cmp::cells
