// Decides whether a bright place is the white cell: white inside and not white outside.
#pragma once

#include "base/array.hpp"
#include "numbering/plane_point.hpp"

namespace cmp::numbering {

// The places that are sampled, as axial steps from the center of the white cell.
struct WhiteCellPoints {
  static constexpr bool is_lasting = true;  // read once, as base/binding.hpp says
  View<const double, 2> inside;             // (P, 2) in the three corners, then anywhere in the cell
  View<const double, 2> outside;            // (Q, 2) beyond the corners and the sides
  View<const double, 2> centroid;           // (R, 2) a grid

  template <class F>
  static WhiteCellPoints read(const F& f) {
    return {f["inside"], f["outside"], f["centroid"]};
  }
};

// Limits of the white cell; explained in extractor/numbering/white_cell.py.
struct WhiteCellLimits {
  Index max_fit_cells, min_fit_cells;
  double ridge, weight_softening, min_pivot_share, max_predicted_deviation, max_centroid_distance;
  double min_inside, min_corner, max_outside, min_reach, sample_radius;
  WhiteCellPoints points;

  template <class F>
  static WhiteCellLimits read(const F& f) {
    return {f["max_fit_cells"],
            f["min_fit_cells"],
            f["ridge"],
            f["weight_softening"],
            f["min_pivot_share"],
            f["max_predicted_deviation"],
            f["max_centroid_distance"],
            f["min_inside"],
            f["min_corner"],
            f["max_outside"],
            f["min_reach"],
            f["sample_radius"],
            f["points"]};
  }
};

// The layout for the search of the white cell.
struct WhiteCellLayout {
  Index layers;
  View<const std::int32_t, 2> cell_lookup;  // (S, S) of the lattice
  View<const double, 1> white_mm;           // (2,) the center of the white cell
  View<const double, 2> axial_mm;           // (2, 2) mm per axial step there
  View<const double, 2> center_mm;          // (U, 2) the centers of the colored cells

  template <class F>
  static WhiteCellLayout read(const F& f) {
    return {f["layers"], f["cell_lookup"], f["white_mm"], f["axial_mm"], f["center_mm"]};
  }
};

// The center of the white cell, px, where the numbers predict it; NaN if it is not there.
//
// image (H, W, 3) BGR without gaps; center_px (N, 2); cell (N,), the layout's cell of each cell of the image,
// or -1; inks (4, 3), the colors of red, green and blue in rows 1 to 3; black (3,), the color between them.
PlanePoint locate_white_cell(View<const std::uint8_t, 3> image, View<const double, 2> center_px,
                             View<const std::int32_t, 1> cell, const WhiteCellLayout& layout,
                             View<const double, 2> inks, View<const double, 1> black,
                             const WhiteCellLimits& limits);

}  // namespace cmp::numbering
