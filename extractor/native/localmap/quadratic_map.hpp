// Predicts a detached cell's place in the layout by a quadratic map through the numbered cells nearest to it.
//
// These numbered cells are its support cells. The map goes from the image to the layout.
#pragma once

#include "layout/lattice_tables.hpp"

namespace cmp::localmap {

inline constexpr Index SUPPORT_CELLS = 20;       // numbered cells of a map
inline constexpr Index QUADRATIC_MAP_TERMS = 6;  // 1, x, y, xx, xy, yy
// Columns of a support cell's products: 15 monomials, the terms by its place in the layout, the distance's
// weight.
inline constexpr Index PRODUCT_COLUMNS = 32;

// Limits of the map; explained in extractor/localmap/quadratic_map.py.
struct QuadraticMapLimits {
  double max_support_distance, max_deviation;
  Index robust_rounds;
  double exact_misfit, distance_softening, ridge, min_pivot;

  template <class F>
  static QuadraticMapLimits read(const F& f) {
    return {f["max_support_distance"], f["max_deviation"], f["robust_rounds"], f["exact_misfit"],
            f["distance_softening"],   f["ridge"],         f["min_pivot"]};
  }
};

// Memory for one quadratic map.
struct MapBuffers {
  template <Index N>
  using Row = std::array<double, N>;

  std::array<Row<PRODUCT_COLUMNS>, SUPPORT_CELLS> products{};  // of the support cells
  std::array<Row<SUPPORT_CELLS>, QUADRATIC_MAP_TERMS>
      terms{};  // of the support cells, one term after the other
  Row<SUPPORT_CELLS> place_x{}, place_y{}, distance_weights{};  // of the support cells, mm, mm
  Row<PRODUCT_COLUMNS> sums{};                                  // the weighted sums of the products
  Row<SUPPORT_CELLS> weights{};                                 // by distance and misfit
  Row<SUPPORT_CELLS> squared_misfits{};                         // mm^2
  std::array<Row<QUADRATIC_MAP_TERMS>, 3>
      right{};  // the right sides for x, y and the leverage, then the solutions
};

// A place in the layout.
struct LayoutPlace {
  double x_mm, y_mm;    // NaN where the place is uncertain
  double cell_size_mm;  // the mean side of the cells there
};

// Numbered cells of the image in the layout.
struct NumberedCells {
  View<const double, 2> center_px;      // (N, 2) the cells' centers
  View<const std::int64_t, 1> support;  // (K,) the numbered cells of the image
  View<const std::int32_t, 1> cell;     // (N,) the layout's cell of each cell of the image
};

// Predicts the place of cell i in the layout.
//
// Lengths are in units of the support cells' mean distance, with cell i at the origin: the map's first term
// is the place.
//
// nearest (C,) indices into `support`, the nearest first, C <= SUPPORT_CELLS; squared_distance (C or more,)
// px^2.
LayoutPlace fill_quadratic_map(const NumberedCells& cells, Index i, View<const std::int32_t, 1> nearest,
                               View<const double, 1> squared_distance, const layout::LayoutCells& layout,
                               const QuadraticMapLimits& limits, MapBuffers& buffers);

}  // namespace cmp::localmap
