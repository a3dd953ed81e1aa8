// The shift of each ink: where colors are applied one after the other, all cells of one color lie off alike.
//
// A gridline is a side of one colored cell and lies off with that cell. The three sides of a cell tell where
// the cell lies. Errors of the markers move cells of all colors alike, so the median over the cells of one
// color, less the mean of the three colors, is the shift of that ink. The pattern is drawn with the shifts,
// and solved without: the markers are the places on which the three colors agree. Such a marker has a
// second place, where its gridlines cross as they are seen, by least squares: each ink has two of the six. A
// point on a gridline has two places, too, on the gridline that joins the markers and on the seen one. All
// are stated in the middle between both, with half of the distance as a deviation that covers both.
#pragma once

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::refine {

inline constexpr Index SHIFTED_INKS = 3;  // red, green, blue

// Limits of the inks' shifts.
struct InkShiftLimits {
  Index min_cells = 12;  // of each ink; with fewer, the shifts are taken as 0. Chosen.
  // in units of the blur; lateral color, compression and lamps of two colors look like less, which is taken
  // as 0. Chosen, as for dot gain.
  double min_shift = 0.1;
  double deviations = 4.0;        // of a shift from its noise; with less, it is taken as 0. Chosen.
  double min_determinant = 0.02;  // of a cell's three normals, relative to the squared trace. Chosen.
};

// (3, 2) the shifts of the inks in the layout, in units of the mean edge, their mean 0; all 0 where none is
// seen.
//
// sums (E, 24), gradients and lines (E, 8) of gridlines that are drawn with shifts `drawn` (3, 2); maps (M,
// 2, 5); sigma px, the blur.
Array<double, 2> measure_ink_shift(View<const double, 2> sums, const ShiftGradients& gradients,
                                   View<const double, 2> lines, View<const double, 2> drawn,
                                   View<const double, 3> maps, double sigma, const layout::Topology& topology,
                                   const InkShiftLimits& limits);

// (E,) px, by how much shifts (3, 2) of the inks move the gridlines (E, 8) along their normals (-uy, ux).
Array<double, 1> ink_offsets(View<const double, 2> shift, View<const double, 2> lines,
                             View<const double, 3> maps, const layout::Topology& topology);

// Removes the change of the inks' shifts from `drawn` to `found`, (3, 2) each, from the sums and gradients.
void update_without_ink_shift(View<double, 2> sums, ShiftGradients& gradients, View<const double, 2> lines,
                              View<const double, 2> drawn, View<const double, 2> found,
                              View<const double, 3> maps, const layout::Topology& topology);

// Where the points of gridlines (E,) are stated, along the normals (-uy, ux).
struct GridlinesBetween {
  Array<double, 1> offset;    // px, from there to where a gridline is seen
  Array<double, 1> variance;  // px^2, of this place, which covers both places
};

// The places between the gridlines that join the markers and the lines (E, 8), which are drawn with the
// shifts.
GridlinesBetween gridlines_between(View<const double, 2> shift, View<const double, 2> lines,
                                   View<const double, 3> maps, const layout::Topology& topology);

// Moves the gridlines (E, 8) along their normals by offsets (E,) px.
void update_with_offsets(View<double, 2> lines, View<const double, 1> offset);

// Moves markers (M, 2) px from where the inks agree half of the way to where their gridlines (E, 8) cross;
// the covariances (M, 2, 2) px^2 cover both places.
void update_between_places(View<double, 2> xy, View<double, 3> cov, View<const double, 2> shift,
                           View<const double, 2> lines, View<const double, 3> maps,
                           const layout::Topology& topology, const InkShiftLimits& limits);

}  // namespace cmp::refine
