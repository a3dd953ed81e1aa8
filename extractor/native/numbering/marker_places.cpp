#include "numbering/marker_places.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "localmap/local_map.hpp"
#include "numbering/plane_point.hpp"

namespace cmp::numbering {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr int X = 0, Y = 1, EDGE = 2, WEIGHT = 3;  // columns of a marker's sums
constexpr double FITTED_WEIGHT = 1.0;

using Triangle = std::array<PlanePoint, 3>;

// The N cells of the image with their local maps.
struct MappedCells {
  View<const double, 2> centre_px;   // (N, 2)
  View<const double, 3> corner_px;   // (N, 3, 2) of the triangles, clockwise
  View<const double, 3> slope;       // (N, 2, 2) px per mm, NaN where unknown
  View<const std::int32_t, 1> cell;  // (N,) the layout's cell, or -1
  bool mirrored;                     // the pattern is seen from its back
};

// The corners of the C numbered cells with a local map, by the layout's corners 0, 1, 2.
struct CellCorners {
  Array<std::int32_t, 2> ids;  // (C, 3) marker ids
  Array<double, 3> corner_px;  // (C, 3, 2) of the cell's triangle where that is fitted, else predicted
  Array<double, 1> edge_px;    // (C,) the mean predicted edge
  Array<bool, 1> is_fitted;    // (C,) the triangle agrees with the prediction
};

PlanePoint point_of(View<const double, 2> xy, Index m) { return {xy(m, 0), xy(m, 1)}; }

Triangle triangle_of(View<const double, 3> corner_px, Index n) {
  Triangle out;
  for (int k = 0; k < 3; ++k) out[k] = {corner_px(n, k, 0), corner_px(n, k, 1)};
  return out;
}

void fill_triangle(View<double, 3> corner_px, Index n, const Triangle& triangle) {
  for (int k = 0; k < 3; ++k) {
    corner_px(n, k, 0) = triangle[k].x;
    corner_px(n, k, 1) = triangle[k].y;
  }
}

// The index of the least of three numbers, or of the first NaN.
int index_of_least(const std::array<double, 3>& values) {
  int least = 0;
  for (int k = 0; k < 3; ++k) {
    if (std::isnan(values[k])) return k;
    if (values[k] < values[least]) least = k;
  }
  return least;
}

// How a cell's triangle lies on its predicted corners.
struct TriangleFit {
  int first;  // the triangle's corner that is corner 0
  bool is_fitted;
};

// Compares a triangle with the predicted corners, in all three rotations.
TriangleFit fit_triangle(const Triangle& triangle, const Triangle& corner, int corner_step, double edge_px,
                         const CornerLimits& limits) {
  std::array<double, 3> misfit{0.0, 0.0, 0.0};
  for (int first = 0; first < 3; ++first)
    for (int k = 0; k < 3; ++k) {
      const double square = squared_distance(triangle[(first + corner_step * k) % 3], corner[k]);
      misfit[first] = !(square <= misfit[first]) ? square : misfit[first];  // NaN is kept
    }
  const int best = index_of_least(misfit);
  const double limit = limits.max_corner_misfit * edge_px;
  return {best, misfit[best] < limit * limit};
}

// The corners of cell i by its map; vectors_mm (U, 3, 2) from the layout's centres to the corners.
Triangle predicted_triangle(const MappedCells& cells, Index i, View<const double, 3> vectors_mm) {
  const auto centre = cells.centre_px;
  const auto slope = cells.slope;
  const std::int32_t u = cells.cell[i];
  Triangle out;
  for (int k = 0; k < 3; ++k) {
    const double x = vectors_mm(u, k, 0), y = vectors_mm(u, k, 1);
    out[k] = {centre(i, 0) + (slope(i, 0, 0) * x + slope(i, 0, 1) * y),
              centre(i, 1) + (slope(i, 1, 0) * x + slope(i, 1, 1) * y)};
  }
  return out;
}

using Map = localmap::LocalMap<1>;

// Writes the slope (2, 2) of a map, px per mm.
void fill_slope(const Map& map, View<double, 2> out) {
  for (int axis = 0; axis < 2; ++axis)
    for (int k = 0; k < 2; ++k) out(axis, k) = map.coefficients(axis)[k + 1];
}

// The linear maps around numbered cells, through their centres.
class CellMaps {
 public:
  CellMaps(const TriangularCells& cells, const CellNumbers& numbers, const layout::LayoutCells& layout,
           const CornerLimits& limits)
      : cells_(cells),
        cell_(numbers.cell),
        corner_step_(numbers.mirrored ? 1 : 2),
        layout_(layout),
        limits_(limits),
        image_cell_({layout.centre_mm.size()}, -1) {
    for (Index i = 0; i < cell_.size(); ++i)
      if (cell_[i] >= 0) image_cell_[cell_[i]] = static_cast<std::int32_t>(i);
  }

  // (N, 2, 2) px per mm: by the six cells around, or at the rims of holes, where these are too few, by the
  // cell's triangle, if a neighbour shows which of its corners is which; NaN without either.
  //
  // The millimetres of the layout contain the pattern's own shape, so a round pattern is no more curved than
  // a honeycomb.
  Array<double, 3> slopes() const {
    Array<double, 3> out({cell_.size(), 2, 2}, NOWHERE);
    for (Index i = 0; i < cell_.size(); ++i) {
      if (cell_[i] < 0) continue;
      Map map = empty_map(i);
      for_neighbours(i, [&](std::int32_t v, Index j) {
        map.add(layout_.centre_mm(v, 0), layout_.centre_mm(v, 1), cells_.centre_px(j, 0),
                cells_.centre_px(j, 1));
      });
      if (map.solve(PINNED, limits_.min_spread))
        fill_slope(map, out.view()[i]);
      else if (!std::isnan(cells_.corner_px(i, 0, 0)))
        fill_by_triangle(i, out.view()[i]);
    }
    return out;
  }

 private:
  static constexpr localmap::MapRidge PINNED{.constant = localmap::RIGID};

  Map empty_map(Index i) const {
    const std::int32_t u = cell_[i];
    return Map({layout_.centre_mm(u, 0), layout_.centre_mm(u, 1), 1.0, cells_.centre_px(i, 0),
                cells_.centre_px(i, 1), 1.0});
  }
  template <class Visit>
  void for_neighbours(Index i, Visit visit) const {
    for (const std::int32_t v : layout_.cell_neighbours[cell_[i]])
      if (v >= 0 && image_cell_[v] >= 0) visit(v, Index{image_cell_[v]});
  }
  // The map that carries a cell's corners onto its triangle, whose corner `first` is corner 0.
  Map map_by_triangle(Index i, Index first) const {
    Map map = empty_map(i);
    for (int k = 0; k < 3; ++k) {
      const std::int32_t u = cell_[i];
      const Index corner = (first + corner_step_ * k) % 3;
      map.add(layout_.centre_mm(u, 0) + layout_.corner_vectors_mm(u, k, 0),
              layout_.centre_mm(u, 1) + layout_.corner_vectors_mm(u, k, 1), cells_.corner_px(i, corner, 0),
              cells_.corner_px(i, corner, 1));
    }
    map.solve(PINNED, 0.0);
    return map;
  }
  // The largest distance from a neighbour to its prediction, over that to the cell; 0 without a neighbour.
  double misfit_of(Index i, const Map& map) const {
    double misfit = 0.0;
    for_neighbours(i, [&](std::int32_t v, Index j) {
      const double x = cells_.centre_px(j, 0), y = cells_.centre_px(j, 1);
      const auto [px, py] = map.at(layout_.centre_mm(v, 0), layout_.centre_mm(v, 1));
      misfit = std::max(misfit, std::hypot(px - x, py - y) /
                                    std::hypot(x - cells_.centre_px(i, 0), y - cells_.centre_px(i, 1)));
    });
    return misfit;
  }
  void fill_by_triangle(Index i, View<double, 2> out) const {
    std::array<double, 3> misfit;
    for (Index first = 0; first < 3; ++first) misfit[first] = misfit_of(i, map_by_triangle(i, first));
    const Index best = std::min_element(misfit.begin(), misfit.end()) - misfit.begin();
    const double rival = std::min(misfit[(best + 1) % 3], misfit[(best + 2) % 3]);
    if (misfit[best] < limits_.max_triangle_misfit && rival > limits_.min_rival_misfit)
      fill_slope(map_by_triangle(i, best), out);
  }

  const TriangularCells& cells_;
  View<const std::int32_t, 1> cell_;
  int corner_step_;  // clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2
  const layout::LayoutCells& layout_;
  const CornerLimits& limits_;
  Array<std::int32_t, 1> image_cell_;
};

// (M, 4) the weighted sums of x, y and edge, and of the weights, at each marker.
Array<double, 2> corner_sums(const CellCorners& corners, Index count, double predicted_weight) {
  Array<double, 2> out({count, 4}, 0.0);
  const auto sums = out.view();
  for (Index n = 0; n < corners.ids.size(); ++n) {
    const double weight = corners.is_fitted[n] ? FITTED_WEIGHT : predicted_weight;
    for (int k = 0; k < 3; ++k) {
      const auto sum = sums[corners.ids(n, k)];
      sum[X] += weight * corners.corner_px(n, k, 0);
      sum[Y] += weight * corners.corner_px(n, k, 1);
      sum[EDGE] += weight * corners.edge_px[n];
      sum[WEIGHT] += weight;
    }
  }
  return out;
}

// (M,) how many of the fitted triangles at each marker agree on its place (M, 2).
Array<std::int64_t, 1> count_agreeing(const CellCorners& corners, View<const double, 2> xy,
                                      const CornerLimits& limits) {
  const double agreed2 = limits.max_agreed_spread * limits.max_agreed_spread;
  Array<std::int64_t, 1> agreeing({xy.size()}, 0);
  const auto agreed = agreeing.view();
  const auto ids = corners.ids.view();
  for (Index n = 0; n < corners.ids.size(); ++n) {
    if (!corners.is_fitted[n]) continue;
    const Triangle corner = triangle_of(corners.corner_px, n);
    double shortest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k)
      shortest = std::min(shortest, squared_distance(corner[k], corner[(k + 1) % 3]));
    for (int k = 0; k < 3; ++k) {
      const std::int32_t m = ids(n, k);
      agreed[m] += squared_distance(corner[k], point_of(xy, m)) < agreed2 * shortest;
    }
  }
  return agreeing;
}

// The corners of the cells with a slope.
//
// vectors_mm (U, 3, 2) from the layout's centres to the corners; corner_ids (U, 3), their markers.
CellCorners cell_corners(const MappedCells& cells, View<const double, 3> vectors_mm,
                         View<const std::int32_t, 2> corner_ids, const CornerLimits& limits) {
  Array<Index, 1> here({cells.slope.size()});
  Index count = 0;
  for (Index i = 0; i < cells.slope.size(); ++i)
    if (std::isfinite(cells.slope(i, 0, 0))) here[count++] = i;
  // clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2
  const int corner_step = cells.mirrored ? 1 : 2;
  Array<std::int32_t, 2> ids({count, 3});
  Array<double, 3> corner_px({count, 3, 2});
  Array<double, 1> edge({count});
  Array<bool, 1> fitted({count});
  for (Index n = 0; n < count; ++n) {
    const Index i = here[n];
    const Triangle predicted = predicted_triangle(cells, i, vectors_mm);
    const Triangle triangle = triangle_of(cells.corner_px, i);
    double edge_px = 0.0;
    for (int k = 0; k < 3; ++k) {
      ids(n, k) = corner_ids(cells.cell[i], k);
      edge_px += std::sqrt(squared_distance(predicted[k], predicted[(k + 1) % 3])) / 3;
    }
    edge[n] = edge_px;
    const TriangleFit fit = fit_triangle(triangle, predicted, corner_step, edge_px, limits);
    Triangle turned;  // by the layout's corners
    for (int k = 0; k < 3; ++k) turned[k] = triangle[(fit.first + corner_step * k) % 3];
    fill_triangle(corner_px, n, fit.is_fitted ? turned : predicted);
    fitted[n] = fit.is_fitted;
  }
  return {std::move(ids), std::move(corner_px), std::move(edge), std::move(fitted)};
}

}  // namespace

InitialMarkers merge_corners(const TriangularCells& cells, const CellNumbers& numbers,
                             const layout::LayoutCells& layout, View<const std::int32_t, 2> corner_ids,
                             Index markers, const CornerLimits& limits) {
  const Array<double, 3> slope = CellMaps(cells, numbers, layout, limits).slopes();
  const CellCorners corners =
      cell_corners({cells.centre_px, cells.corner_px, slope, numbers.cell, numbers.mirrored},
                   layout.corner_vectors_mm, corner_ids, limits);
  const auto sums = corner_sums(corners, markers, limits.predicted_weight);
  Array<double, 2> xy({markers, 2}, NOWHERE);
  Array<double, 1> edge({markers}, NOWHERE);
  for (Index m = 0; m < markers; ++m) {
    const double weight = sums(m, WEIGHT);
    if (weight > 0.0) {
      xy(m, 0) = sums(m, X) / weight;
      xy(m, 1) = sums(m, Y) / weight;
      edge[m] = sums(m, EDGE) / weight;
    }
  }
  const Array<std::int64_t, 1> agreeing = count_agreeing(corners, xy, limits);
  Array<std::int64_t, 1> meeting({markers}, 0);
  for (Index u = 0; u < corner_ids.size(); ++u)
    for (const std::int32_t m : corner_ids[u]) ++meeting[m];
  Array<bool, 1> agreed({markers}), is_intact({markers});
  for (Index m = 0; m < markers; ++m) {
    const CornerAgreement agreement(agreeing[m], meeting[m]);
    agreed[m] = agreement.agreed;
    is_intact[m] = agreement.is_intact;
  }
  return {std::move(xy), std::move(edge), std::move(agreed), std::move(is_intact)};
}

}  // namespace cmp::numbering
