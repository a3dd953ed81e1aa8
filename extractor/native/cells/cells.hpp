// Between recognition and numbering: the colored cells, with their triangles and centers.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::cells {

inline constexpr int COUNT_RADII = 6;  // radii within which cells are counted

// The limits of the cells; the Python module explains them.
struct CellLimits {
  std::int64_t nearest_cells;
  double min_area_share;
  std::int64_t max_larger_than_cell;
  double min_intact_share;
  std::int64_t max_larger_than_intact;
  double min_triangle_share;
  std::array<double, COUNT_RADII> count_radii;

  template <class F>
  static CellLimits read(const F& f) {
    return {f["nearest_cells"],    f["min_area_share"],         f["max_larger_than_cell"],
            f["min_intact_share"], f["max_larger_than_intact"], f["min_triangle_share"],
            f["count_radii"]};
  }
};

// The image's N colored cells.
struct CellArrays {
  View<const double, 2> center_px;  // (N, 2) in the image frame
  View<const std::uint8_t, 1> ink;  // (N,) 1 red, 2 green, 3 blue
  View<const double, 1> area_px;    // (N,) px^2
  View<const double, 3> corner_px;  // (N, 3, 2) clockwise in the image; NaN where the region is no triangle
  View<const bool, 1> is_intact;    // (N,) cells with a reliable center

  template <class F>
  static CellArrays read(const F& f) {
    return {f["center_px"], f["ink"], f["area_px"], f["corner_px"], f["is_intact"]};
  }
};

// The centers (N, 2), inks (N,), areas (N,) and corners (N, 3, 2) of cells, as in CellArrays.
using FoundCells = std::tuple<Array<double, 2>, Array<std::uint8_t, 1>, Array<double, 1>, Array<double, 3>>;

// The domains that are large enough for cells, at full scale; in a cluttered image only the triangles.
//
// seed_center (D, 2), ink (D,) and area_px (D,) of the domains, at 1/scale of the image's scale; region (T,)
// the domains of the triangles corner_px (T, 3, 2), at full scale.
FoundCells cell_arrays(View<const double, 2> seed_center, View<const std::uint8_t, 1> ink,
                       View<const std::int64_t, 1> area_px, View<const std::int32_t, 1> region,
                       View<const double, 3> corner_px, Index scale, bool cluttered,
                       const CellLimits& limits);

// The edge of an equilateral triangle of the median of the areas (N,), px^2; 0 without areas.
double equilateral_edge(View<const double, 1> area);

// (N,) the cells about as large as their neighbours; where most are triangles, triangles only.
//
// center (N, 2), area (N,), corner (N, 3, 2) as in CellArrays.
Array<bool, 1> is_intact(View<const double, 2> center, View<const double, 1> area,
                         View<const double, 3> corner, const CellLimits& limits);

}  // namespace cmp::cells
