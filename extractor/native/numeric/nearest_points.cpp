#include "numeric/nearest_points.hpp"

#include <cmath>
#include <limits>

namespace cmp::numeric {

namespace {

constexpr double POINTS_PER_BUCKET = 2.0;  // mean number of points in a bucket
constexpr double SMALLEST_STEP = 1e-9;     // of buckets, where all points are one

struct Range {
  double low, high;
};

Range range_of(View<const double, 2> xy, int axis) {
  Range range{xy(0, axis), xy(0, axis)};
  for (Index i = 1; i < xy.size(); ++i) {
    range.low = std::min(range.low, xy(i, axis));
    range.high = std::max(range.high, xy(i, axis));
  }
  return range;
}

// The points nearest to a place among those seen until now.
class Nearest {
 public:
  Nearest(const BucketGrid& grid, double x, double y, View<std::int32_t, 1> index,
          View<double, 1> squared_distance)
      : xy_(grid.xy),
        begin_(grid.begin),
        order_(grid.order),
        x_(x),
        y_(y),
        index_(index),
        squared_distance_(squared_distance) {}

  // Adds the points of the buckets first to last.
  void add(Index first, Index last) {
    for (std::int32_t k = begin_[first]; k < begin_[last + 1]; ++k) {
      const std::int32_t i = order_[k];
      const double dx = xy_(i, 0) - x_, dy = xy_(i, 1) - y_;
      const double square = dx * dx + dy * dy;
      if (is_full() && square >= squared_distance_[found_ - 1]) continue;
      Index at = is_full() ? found_ - 1 : found_;
      found_ = std::min(found_ + 1, index_.size());
      for (; at > 0 && squared_distance_[at - 1] > square; --at) {
        squared_distance_[at] = squared_distance_[at - 1];
        index_[at] = index_[at - 1];
      }
      squared_distance_[at] = square;
      index_[at] = i;
    }
  }
  bool is_full() const { return found_ == index_.size(); }
  Index found() const { return found_; }
  double farthest_square() const { return squared_distance_[found_ - 1]; }

 private:
  View<const double, 2> xy_;
  View<const std::int32_t, 1> begin_, order_;
  double x_, y_;
  View<std::int32_t, 1> index_;
  View<double, 1> squared_distance_;
  Index found_ = 0;
};

}  // namespace

BucketGrid bucket_grid(View<const double, 2> xy) {
  const Index count = xy.size();
  const Range along = range_of(xy, 0), down = range_of(xy, 1);
  const double low_x = along.low, low_y = down.low;
  const double width = along.high - low_x, height = down.high - low_y, points = static_cast<double>(count);
  // never more buckets along a side than points, however long and thin the cloud
  const double step = std::max({std::sqrt(width * height * POINTS_PER_BUCKET / points),
                                std::max(width, height) / points, SMALLEST_STEP});
  const Index columns = static_cast<Index>(width / step) + 1, rows = static_cast<Index>(height / step) + 1;
  BucketGrid grid{xy,
                  low_x,
                  low_y,
                  step,
                  columns,
                  Array<std::int32_t, 1>({rows * columns + 1}, 0),
                  Array<std::int32_t, 1>({count})};
  Array<std::int32_t, 1> bucket({count});
  const auto begin = grid.begin.view(), order = grid.order.view(), bucket_of = bucket.view();
  for (Index i = 0; i < count; ++i) {
    bucket_of[i] = static_cast<std::int32_t>(static_cast<Index>((xy(i, 1) - low_y) / step) * columns +
                                             static_cast<Index>((xy(i, 0) - low_x) / step));
    ++begin[bucket_of[i] + 1];
  }
  for (Index b = 0; b < rows * columns; ++b) begin[b + 1] += begin[b];
  Array<std::int32_t, 1> filled{View<const std::int32_t, 1>(begin)};
  const auto next = filled.view();
  for (Index i = 0; i < count; ++i) order[next[bucket_of[i]]++] = static_cast<std::int32_t>(i);
  return grid;
}

Index fill_nearest_points(const BucketGrid& grid, double x, double y, View<std::int32_t, 1> index,
                          View<double, 1> squared_distance) {
  const Index columns = grid.columns, rows = (grid.begin.size() - 1) / columns;
  const double step = grid.step, u = (x - grid.low_x) / step, v = (y - grid.low_y) / step;
  const Index column = std::min(std::max<Index>(static_cast<Index>(std::floor(u)), 0), columns - 1);
  const Index row = std::min(std::max<Index>(static_cast<Index>(std::floor(v)), 0), rows - 1);
  Nearest nearest(grid, x, y, index, squared_distance);
  for (Index ring = 0; ring < std::max(rows, columns); ++ring) {
    if (nearest.is_full() && ring > 0) {
      // the remaining points lie outside the rings before this one, and inside the grid
      double remaining = std::numeric_limits<double>::infinity();
      if (column >= ring) remaining = std::min(remaining, u - static_cast<double>(column - ring + 1));
      if (column + ring < columns) remaining = std::min(remaining, static_cast<double>(column + ring) - u);
      if (row >= ring) remaining = std::min(remaining, v - static_cast<double>(row - ring + 1));
      if (row + ring < rows) remaining = std::min(remaining, static_cast<double>(row + ring) - v);
      const double distance = remaining * step;
      if (remaining > 0.0 && nearest.farthest_square() <= distance * distance) break;
    }
    const Index left = std::max<Index>(column - ring, 0), right = std::min(column + ring, columns - 1);
    for (Index line = std::max<Index>(row - ring, 0); line <= std::min(row + ring, rows - 1); ++line) {
      const Index first = line * columns;
      if (line == row - ring || line == row + ring) {
        nearest.add(first + left, first + right);
        continue;
      }
      if (column >= ring) nearest.add(first + left, first + left);
      if (column + ring < columns) nearest.add(first + right, first + right);
    }
  }
  return nearest.found();
}

}  // namespace cmp::numeric
