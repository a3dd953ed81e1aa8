// The colors of an image's cells by the lattice: light over the local black, the fields of a part's three
// classes, and the light at the places of its down-cells.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"

namespace cmp::numbering {

// The limits of the fields; the Python module explains them.
struct InkFieldLimits {
  double place_softening, place_reach2, residual_scale, least_share, least_scatter, bright, towards_corner,
      across_side, corner_likeness, likeness;
  std::int64_t robust_rounds, quadratic_cells, linear_cells;

  template <class F>
  static InkFieldLimits read(const F& f) {
    return {f["place_softening"], f["place_reach2"], f["residual_scale"], f["least_share"],
            f["least_scatter"],   f["bright"],       f["towards_corner"], f["across_side"],
            f["corner_likeness"], f["likeness"],     f["robust_rounds"],  f["quadratic_cells"],
            f["linear_cells"]};
  }
};

// The N cells of an image, walked: the cells of one part have axial coordinates of one frame.
struct WalkedCells {
  View<const double, 2> center_px;    // (N, 2) at full scale
  View<const double, 3> corner_px;    // (N, 3, 2) counter-clockwise as seen from the pattern's front
  View<const std::int32_t, 2> axial;  // (N, 2)
  View<const std::int8_t, 1> first;   // (N,) the corner that is corner 0
  View<const std::int32_t, 1> part;   // (N,) the part, or -1

  CMP_FIELDS(center_px, corner_px, axial, first, part)
};

// (N, 3) the light (B, G, R, units of 1/255) of cells over that of the black cells that share their sides;
// NaN where one of these places is outside the image. center (N, 2), corner (N, 3, 2) without swelling.
Array<double, 2> cell_light(const image::PyramidLevel& view, View<const double, 2> center,
                            View<const double, 3> corner);

// Colors of the cells of one part; light (N, 3) by cell_light.
//
// shares (3, 3), the mean log of each class's share of the light in each channel (B, G, R); odds (N, 3), the
// log likelihoods of each cell of the image for the three classes, relative to the likeliest one; then of the
// part's down-cells the axial places (D, 2), whiteness (D,): light over the local black, relative to the
// strongest inks there, NaN outside the image; and (D,) whether it is bright, and the light fills its
// triangle and no cell beside it. The last one is the share of the part's cells whose color is like that of
// their class's field.
using InkFields = std::tuple<Array<double, 2>, Array<double, 2>, Array<std::int32_t, 2>, Array<double, 1>,
                             Array<bool, 1>, double>;

InkFields ink_fields(const image::PyramidLevel& view, const WalkedCells& cells, View<const double, 2> light,
                     std::int32_t part, const InkFieldLimits& limits);

}  // namespace cmp::numbering
