// Registration of the other parts, a single cell being the smallest, against the parts that are placed.
#pragma once

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"
#include "numbering/ink_fields.hpp"
#include "numbering/map_prior.hpp"

namespace cmp::numbering {

// The limits of parts that are registered against placed ones.
struct AttachmentLimits {
  MapPriorLimits prior;           // of the map
  std::int64_t known_cells = 36;  // placed cells through which a map goes. Chosen.
  // cells of a part by which its motion is judged, those nearest to placed ones. Chosen.
  std::int64_t judged_cells = 16;
  std::int64_t max_rounds = 6;  // passes over all parts. Chosen.
  double stiffness = 0.1;       // of the prior's terms, in the map that looks for places. Chosen.
  // in edges, beyond the nearest place, the farthest of the places that are tried for a cell. Chosen.
  double reach = 3.2;
  double reach_deviations = 4.0;  // of the map, of these places beyond the neighbours. Chosen.
  // in edges, between a cell's corners and those of the map; a triangle that points the other way has 1.15.
  // Chosen.
  double max_corner_misfit = 0.6;
  double max_misfit = 8.0;  // mean log likelihood of the judged cells of an accepted part. Chosen.
  // log likelihood of a cell that lies outside, on a taken place, or nowhere near. Chosen.
  double outside_odds = -12.5;
  double margin = 6.0;  // lead of the best motion. Chosen.
  // the same, in addition, relative to the misfit of the best motion. Chosen.
  double margin_of_misfit = 2.5;
  // log likelihood of a cell's class below which the cell is on a wrong place. Chosen.
  double odd_ink = -8.0;
};

// (N,) the layout's cell of each cell of the image, or -1: those placed, and those of parts that have one
// motion with a small misfit and a large lead; without those whose color is that of another class.
//
// cell (N,), the cells placed before; odds (N, 3), the log likelihoods of each cell for the inks red, green
// and blue; axial (U, 2) and cell_lookup (S, S) of the layout; with_single_cells, whether cells without a
// part are registered, too.
Array<std::int32_t, 1> attach_parts(const WalkedCells& cells, View<const std::int32_t, 1> cell,
                                    View<const double, 2> odds, const layout::LayoutCells& layout,
                                    View<const std::int32_t, 2> axial,
                                    View<const std::int32_t, 2> cell_lookup, bool with_single_cells,
                                    const AttachmentLimits& limits);

}  // namespace cmp::numbering
