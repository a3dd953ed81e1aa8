#include "localmap/quadratic_map.hpp"

#include <cmath>
#include <limits>

#include "numeric/median.hpp"

namespace cmp::localmap {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr Index TERMS = QUADRATIC_MAP_TERMS, FIRST_CURVATURE = 3;
constexpr int FOR_X = 0, FOR_Y = 1, FOR_LEVERAGE = 2;
// The column of each term times each term,
constexpr Index PRODUCT_INDEX[TERMS][TERMS] = {{0, 1, 2, 3, 4, 5},    {1, 3, 4, 6, 7, 8},
                                               {2, 4, 5, 7, 8, 9},    {3, 6, 7, 10, 11, 12},
                                               {4, 7, 8, 11, 12, 13}, {5, 8, 9, 12, 13, 14}};
constexpr Index PLACE_X = 15, PLACE_Y = 21;  // and of the terms times the place

struct Misfit {
  double variance, leverage;  // mm^2 about the map; at the origin
};

// Writes a support cell at (x, y), which is at (u, v) in the layout.
void fill_support_cell(MapBuffers& buffers, Index k, double x, double y, double u, double v) {
  auto& row = buffers.products[k];
  const double xx = x * x, xy = x * y, yy = y * y;
  const std::array<double, PLACE_X> monomials{
      1.0, x, y, xx, xy, yy, x * xx, x * xy, x * yy, y * yy, xx * xx, xx * xy, xx * yy, xy * yy, yy * yy};
  std::copy(monomials.begin(), monomials.end(), row.begin());
  for (Index a = 0; a < TERMS; ++a) {
    row[PLACE_X + a] = row[a] * u;
    row[PLACE_Y + a] = row[a] * v;
    buffers.terms[a][k] = row[a];
  }
  buffers.place_x[k] = u;
  buffers.place_y[k] = v;
}

// Writes the weighted sums of the products, four support cells at once.
void fill_weighted_sums(MapBuffers& buffers) {
  std::array<double, PRODUCT_COLUMNS> sums{};
  static_assert(SUPPORT_CELLS % 4 == 0);
  for (Index k = 0; k < SUPPORT_CELLS; k += 4) {
    const auto& weight = buffers.weights;
    const double a = weight[k], b = weight[k + 1], c = weight[k + 2], d = weight[k + 3];
    const auto &one = buffers.products[k], &two = buffers.products[k + 1];
    const auto &three = buffers.products[k + 2], &four = buffers.products[k + 3];
    for (Index m = 0; m < PRODUCT_COLUMNS; ++m)
      sums[m] += a * one[m] + b * two[m] + c * three[m] + d * four[m];
  }
  buffers.sums = sums;
}

// Writes the solutions of the first SIDES sides, 2 or 3; false where a pivot is too small.
//
// Elimination without roots and with one quotient per term, because each step waits for the one before.
// Unrolled, because counting such short loops costs as much as their terms.
template <int SIDES>
bool fill_solutions(const std::array<double, PRODUCT_COLUMNS>& sums, double ridge, double min_pivot,
                    std::array<std::array<double, TERMS>, 3>& out) {
  double normal[TERMS][TERMS], right[SIDES][TERMS];
  double largest = 0.0;
  for (Index a = 0; a < TERMS; ++a) {
    for (Index b = 0; b <= a; ++b) normal[a][b] = sums[PRODUCT_INDEX[a][b]];
    normal[a][a] += a >= FIRST_CURVATURE ? ridge : 0.0;
    largest = std::max(largest, normal[a][a]);
    right[FOR_X][a] = sums[PLACE_X + a];
    right[FOR_Y][a] = sums[PLACE_Y + a];
    if constexpr (SIDES > FOR_LEVERAGE) right[FOR_LEVERAGE][a] = a == 0 ? 1.0 : 0.0;
  }
#pragma GCC unroll 6
  for (Index j = 0; j < TERMS; ++j) {
    if (!(normal[j][j] > min_pivot * largest)) return false;
    const double inverse = 1.0 / normal[j][j];
#pragma GCC unroll 6
    for (Index i = j + 1; i < TERMS; ++i) {
      const double factor = normal[i][j] * inverse;
#pragma GCC unroll 6
      for (Index k = j + 1; k <= i; ++k) normal[i][k] -= factor * normal[k][j];
#pragma GCC unroll 6
      for (int side = 0; side < SIDES; ++side) right[side][i] -= factor * right[side][j];
    }
    normal[j][j] = inverse;
  }
#pragma GCC unroll 6
  for (Index j = TERMS - 1; j >= 0; --j)
#pragma GCC unroll 6
    for (int side = 0; side < SIDES; ++side) {
      right[side][j] *= normal[j][j];
#pragma GCC unroll 6
      for (Index i = 0; i < j; ++i) right[side][i] -= normal[j][i] * right[side][j];
    }
  for (int side = 0; side < SIDES; ++side) std::copy_n(right[side], TERMS, out[side].begin());
  return true;
}

// Writes the squared distances, mm^2, between the support cells' places by the map and in the layout.
void fill_squared_misfits(MapBuffers& buffers) {
  const auto terms_x = buffers.right[FOR_X], terms_y = buffers.right[FOR_Y];
  for (Index k = 0; k < SUPPORT_CELLS; ++k) {  // all of them: the compiler vectorises loops of a known length
    double u = -buffers.place_x[k], v = -buffers.place_y[k];
    for (Index a = 0; a < TERMS; ++a) {
      u += buffers.terms[a][k] * terms_x[a];
      v += buffers.terms[a][k] * terms_y[a];
    }
    buffers.squared_misfits[k] = u * u + v * v;
  }
}

// Writes the weights by distance and misfit (scale `scale2`, mm^2); returns the variance about the map, mm^2.
double fill_robust_weights(MapBuffers& buffers, Index count, double scale2) {
  for (Index k = 0; k < SUPPORT_CELLS; ++k)
    buffers.weights[k] = buffers.distance_weights[k] * scale2 / (scale2 + buffers.squared_misfits[k]);
  double total = 0.0, weighted = 0.0;
  for (Index k = 0; k < count; ++k) {
    total += buffers.weights[k];
    weighted += buffers.weights[k] * buffers.squared_misfits[k];
  }
  return weighted / (2.0 * total);
}

// Writes the map's terms for x and y by robust least squares; infinite misfits where the support cells lie in
// a row.
Misfit fill_robust_map(MapBuffers& buffers, Index count, double exact2, const QuadraticMapLimits& limits) {
  buffers.weights = buffers.distance_weights;
  Misfit misfit{INFINITE, INFINITE};
  for (Index round = 0; round < limits.robust_rounds; ++round) {
    fill_weighted_sums(buffers);
    const bool is_last = round == limits.robust_rounds - 1;
    const auto solve = is_last ? fill_solutions<3> : fill_solutions<2>;
    if (!solve(buffers.sums, limits.ridge, limits.min_pivot, buffers.right)) return {INFINITE, INFINITE};
    misfit.leverage = buffers.right[FOR_LEVERAGE][0] * buffers.sums[0] / static_cast<double>(count);
    fill_squared_misfits(buffers);
    const View<const double, 1> squares{buffers.squared_misfits.data(), {SUPPORT_CELLS}};
    const double scale2 = 2.0 * numeric::median_of(squares, count) + exact2;
    misfit.variance = fill_robust_weights(buffers, count, scale2);
  }
  return misfit;
}

}  // namespace

LayoutPlace fill_quadratic_map(const NumberedCells& cells, Index i, View<const std::int32_t, 1> nearest,
                               View<const double, 1> squared_distance, const layout::LayoutCells& layout,
                               const QuadraticMapLimits& limits, MapBuffers& buffers) {
  const Index count = nearest.size();
  const double share = 1.0 / static_cast<double>(count);
  double scale = 0.0, size = 0.0, middle_x = 0.0, middle_y = 0.0;
  for (Index k = 0; k < count; ++k) {
    const std::int32_t u = cells.cell[cells.support[nearest[k]]];
    scale += std::sqrt(squared_distance[k]) * share;
    size += layout.size_mm[u] * share;
    middle_x += layout.center_mm(u, 0) * share;
    middle_y += layout.center_mm(u, 1) * share;
  }
  const double unit = 1.0 / scale;
  for (Index k = 0; k < count; ++k) {
    const Index j = cells.support[nearest[k]];
    const std::int32_t u = cells.cell[j];
    const double x = (cells.center_px(j, 0) - cells.center_px(i, 0)) * unit;
    const double y = (cells.center_px(j, 1) - cells.center_px(i, 1)) * unit;
    fill_support_cell(buffers, k, x, y, layout.center_mm(u, 0) - middle_x, layout.center_mm(u, 1) - middle_y);
    buffers.distance_weights[k] = 1.0 / (limits.distance_softening + squared_distance[k] * (unit * unit));
  }
  std::fill(buffers.distance_weights.begin() + count, buffers.distance_weights.end(), 0.0);
  const double exact = limits.exact_misfit * size;
  const Misfit misfit = fill_robust_map(buffers, count, exact * exact, limits);
  const auto &x = buffers.right[FOR_X], &y = buffers.right[FOR_Y];
  const double slope = std::sqrt(std::abs(x[1] * y[2] - x[2] * y[1])) * unit;
  const bool is_certain = std::sqrt(squared_distance[0]) * slope < limits.max_support_distance * size &&
                          std::sqrt(misfit.variance * (1.0 + misfit.leverage)) < limits.max_deviation * size;
  if (!is_certain) return {NOWHERE, NOWHERE, size};
  return {middle_x + x[0], middle_y + y[0], size};
}

}  // namespace cmp::localmap
