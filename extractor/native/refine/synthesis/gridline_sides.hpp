// The light on both sides of the gridlines, and the contrast of their values.
//
// A gridline's normal is (-uy, ux). The light `before` the gridline lies on the side of (uy, -ux), the light
// `beyond` on the side of the normal.
#pragma once

#include <vector>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/synthesis/ink_levels.hpp"

namespace cmp::refine {

inline constexpr Index BEFORE = 0, BEYOND = 3;  // first of the three channels on each side
inline constexpr Index SIDE_COLUMNS = 6;

// The sides of known gridlines, whose light may be asked for with several levels of the cells.
class GridlineSides {
 public:
  // lines (E, 8), as gridlines gives them; KNOWN is set to 0 beside cells with an unknown corner. xy (M, 2)
  // px; cells (K, 3) marker ids of the drawn cells; edge_cells (E, 2) the drawn cells on both sides, -1 for
  // none.
  GridlineSides(View<double, 2> lines, View<const double, 2> xy, View<const std::int32_t, 2> cells,
                View<const std::int32_t, 2> edge_cells, const image::PolynomialFrame& frame);

  // (E, 6) light 0 to 255 on both sides of the gridlines, at the middles of the chords, three channels before
  // the gridline and three beyond; 0 where not known.
  Array<double, 2> light(const InkLevels& levels) const;

 private:
  // A cell beside a gridline.
  struct Neighbour {
    Index cell;   // -1 for none
    Index side;   // BEFORE or BEYOND
    double x, y;  // px, from the centroid to the middle of the chord
  };
  struct KnownGridline {
    Index edge;
    std::array<Neighbour, 2> neighbours;
    Monomials terms;  // of the polynomials at the middle of the chord
  };

  Index count_;
  std::vector<KnownGridline> known_;
};

// (E, 3) gray levels: the values before the gridlines less those beyond, for the light on both sides (E, 6).
//
// encoded: as in ResponseTables.
Array<double, 2> value_contrasts(View<const double, 2> sides, View<const float, 1> encoded);

}  // namespace cmp::refine
