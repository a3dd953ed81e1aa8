// Registration of the other parts, a single cell being the smallest, against the parts that are placed.
#pragma once

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"
#include "numbering/ink_fields.hpp"
#include "numbering/map_prior.hpp"

namespace cmp::numbering {

// The limits of attachment; the Python module explains them.
struct AttachmentLimits {
  MapPrior prior;
  std::int64_t known_cells, judged_cells, max_rounds;
  double stiffness, reach, reach_deviations, max_corner_misfit, max_misfit, outside_odds, margin,
      margin_of_misfit;
  bool with_single_cells;

  template <class F>
  static AttachmentLimits read(const F& f) {
    return {f["prior"],  f["known_cells"],      f["judged_cells"],      f["max_rounds"], f["stiffness"],
            f["reach"],  f["reach_deviations"], f["max_corner_misfit"], f["max_misfit"], f["outside_odds"],
            f["margin"], f["margin_of_misfit"], f["with_single_cells"]};
  }
};

// (N,) the layout's cell of each cell of the image, or -1: those placed, and those of parts that have one
// motion with a small misfit and a large lead.
//
// cell (N,), the cells placed before; odds (N, 3), the log likelihoods of each cell for the inks red, green
// and blue; axial (U, 2) and cell_lookup (S, S) of the layout.
Array<std::int32_t, 1> attach_parts(const WalkedCells& cells, View<const std::int32_t, 1> cell,
                                    View<const double, 2> odds, const layout::LayoutCells& layout,
                                    View<const std::int32_t, 2> axial,
                                    View<const std::int32_t, 2> cell_lookup, const AttachmentLimits& limits);

}  // namespace cmp::numbering
