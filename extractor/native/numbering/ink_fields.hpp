// The colors of an image's cells by the lattice: light over the local black, the fields of a part's three
// classes, and the light at the places of its down-cells.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"

namespace cmp::numbering {

// The limits of the fields.
struct InkFieldLimits {
  // in squared edges, added to the squared distance of a cell from a down-cell whose place it predicts.
  // Chosen.
  double place_softening = 0.1;
  // squared edges; cells farther away predict no place. Derived: two steps.
  double place_reach2 = 2.5;
  // in median residuals, at which a cell has half of its weight in the fit of a field. Chosen.
  double residual_scale = 2.0;
  // of the strongest field, the least of another one, to take its logarithm. Chosen.
  double least_share = 0.02;
  double least_scatter = 0.15;  // of a field's light, the least scatter of cells. Chosen.
  double bright = 0.6;          // whiteness of a down-cell that is not black. Chosen.
  // share of the way from its centre to its corners, up to which a white cell is white. Chosen: beyond it is
  // blurred.
  double towards_corner = 0.55;
  // share of the way from its centre to those of the cells beside it, from which on these are not white.
  // Chosen: the side lies at a half.
  double across_side = 0.78;
  double corner_likeness = 0.5;  // of the light of the centre, the largest difference there. Chosen.
  // of a field's light, the largest difference of a cell that is like it. Chosen.
  double likeness = 0.5;
  std::int64_t robust_rounds = 4;  // fits of a field, the first ones of lower degrees. Chosen.
  // of a field, from which on its degree is 2 or 1. Derived: three cells for each coefficient.
  std::int64_t quadratic_cells = 18, linear_cells = 9;
};

// The N cells of an image, walked: the cells of one part have axial coordinates of one frame.
struct WalkedCells {
  View<const double, 2> centre_px;    // (N, 2) at full scale
  View<const double, 3> corner_px;    // (N, 3, 2) counter-clockwise as seen from the pattern's front
  View<const std::int32_t, 2> axial;  // (N, 2)
  View<const std::int8_t, 1> first;   // (N,) the corner that is corner 0
  View<const std::int32_t, 1> part;   // (N,) the part, or -1

  CMP_FIELDS(centre_px, corner_px, axial, first, part)
};

// (N, 3) the light (B, G, R, units of 1/255) of cells over that of the black cells that share their sides;
// NaN where one of these places is outside the image. centre (N, 2), corner (N, 3, 2) without swelling.
Array<double, 2> cell_light(const image::PyramidLevel& view, View<const double, 2> centre,
                            View<const double, 3> corner);

// The colors around one part; the Python class explains them.
struct InkFields {
  Array<double, 2> shares;            // (3, 3)
  Array<double, 2> odds;              // (N, 3)
  Array<std::int32_t, 2> down_axial;  // (D, 2)
  Array<double, 1> whiteness;         // (D,)
  Array<bool, 1> is_triangle;         // (D,)
  double fit;

  CMP_RECORD("extractor.numbering.ink_fields.InkFields", shares, odds, down_axial, whiteness, is_triangle,
             fit)
};

// Colors of the cells of one part; light (N, 3) by cell_light.
InkFields ink_fields(const image::PyramidLevel& view, const WalkedCells& cells, View<const double, 2> light,
                     std::int32_t part, const InkFieldLimits& limits);

}  // namespace cmp::numbering
