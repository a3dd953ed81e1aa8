// Room "numeric" for Python.
#include "base/binding.hpp"

#include "base/parts.hpp"
#include "base/processor.hpp"
#include "numeric/bilinear.hpp"
#include "numeric/gaussian.hpp"
#include "numeric/median.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::numeric {

namespace {

// (Q, count) the points (N, 2) that are nearest to each query (Q, 2), the nearest first; count is at most N.
Array<std::int32_t, 2> nearest_points(View<const double, 2> xy, View<const double, 2> queries, Index count) {
  if (count > xy.size()) throw nb::value_error("count is larger than the number of points");
  Array<std::int32_t, 2> index({queries.size(), count});
  if (xy.size() == 0) return index;
  Array<double, 1> squared_distance({count});
  const BucketGrid grid = bucket_grid(xy);
  for (Index q = 0; q < queries.size(); ++q)
    fill_nearest_points(grid, queries(q, 0), queries(q, 1), index[q], squared_distance);
  return index;
}

}  // namespace

void add_numeric(nb::module_ module) {
  bind<&fill_patch_mean>(module, "fill_patch_mean", {"flat", "height", "width", "x", "y", "radius", "out"});
  bind<&nearest_points>(module, "nearest_points", {"xy", "queries", "count"});
  bind<&select>(module, "select", {"values", "place"});
  bind<&median_of>(module, "median_of", {"values", "count"});
  bind<&normal_cdf>(module, "normal_cdf", {"z"});
  bind<&fill_corner_terms>(module, "fill_corner_terms", {"r", "out"});
  bind<&use_widest_vectors>(module, "use_widest_vectors", {"is_widest"});
  bind<&use_parts_from>(module, "use_parts_from", {"items"});
  bind<&wedge_correlation>(module, "wedge_correlation", {"squares", "product", "corner"});
}

}  // namespace cmp::numeric
