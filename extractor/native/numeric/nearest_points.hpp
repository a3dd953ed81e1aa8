// The nearest of many points in the plane, by a grid of buckets.
#pragma once

#include <cmath>

#include "base/array.hpp"

namespace cmp::numeric {

// Points sorted into square buckets, row by row.
struct BucketGrid {
  View<const double, 2> xy;      // (N, 2) the points, which belong to the caller
  double low_x, low_y;           // the least coordinates of the points
  double step;                   // side of a bucket, in the points' unit
  Index columns;                 // buckets in a row
  Array<std::int32_t, 1> begin;  // (rows * columns + 1,) index into `order` at which each bucket begins
  Array<std::int32_t, 1> order;  // (N,) the points' indices, bucket by bucket
};

// The grid of points (N, 2), finite, at least one. It refers to `xy` without a copy.
BucketGrid bucket_grid(View<const double, 2> xy);

// Finds the points of a grid that are nearest to (x, y), the nearest first.
//
// index (K,) receives the points' indices, squared_distance (K,) their squared distances. Returns how many
// points were written: the lesser of K and N.
Index fill_nearest_points(const BucketGrid& grid, double x, double y, View<std::int32_t, 1> index,
                          View<double, 1> squared_distance);

// Calls f(point, squared distance) for each point of a grid that is nearer to (x, y) than a distance.
template <class F>
void for_points_within(const BucketGrid& grid, double x, double y, double distance, const F& f) {
  const Index columns = grid.columns, rows = (grid.begin.size() - 1) / columns;
  const auto bucket = [&grid](double offset, Index count) {
    const double at = std::floor(offset / grid.step);
    return static_cast<Index>(std::min(std::max(at, 0.0), static_cast<double>(count - 1)));
  };
  const Index left = bucket(x - distance - grid.low_x, columns),
              right = bucket(x + distance - grid.low_x, columns);
  const Index bottom = bucket(y + distance - grid.low_y, rows);
  for (Index row = bucket(y - distance - grid.low_y, rows); row <= bottom; ++row)
    for (auto k = grid.begin[row * columns + left]; k < grid.begin[row * columns + right + 1]; ++k) {
      const std::int32_t point = grid.order[k];
      const double dx = grid.xy(point, 0) - x, dy = grid.xy(point, 1) - y, square = dx * dx + dy * dy;
      if (square < distance * distance) f(point, square);
    }
}

}  // namespace cmp::numeric
