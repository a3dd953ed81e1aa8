// Assigns cells without a number to free cells of the layout, those nearest to the numbered ones first.
#pragma once

#include "base/array.hpp"
#include "localmap/quadratic_map.hpp"
#include "numbering/gaps/corner_contact.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

// Limits of assignments; explained in extractor/numbering/gaps/cell_claims.py.
struct CellClaimLimits {
  double joint_gap, joint_gap_ratio, max_place_misfit, rival_distance, max_gap_ratio;
  localmap::QuadraticMapLimits maps;

  template <class F>
  static CellClaimLimits read(const F& f) {
    return {f["joint_gap"],      f["joint_gap_ratio"], f["max_place_misfit"],
            f["rival_distance"], f["max_gap_ratio"],   f["maps"]};
  }
};

// The cells of the image and of the layout.
struct ClaimedCells {
  const cells::CellArrays& cells;
  const layout::LayoutCells& layout;
  const CellClaimLimits& limits;
};

// The numbered intact cells from which places in the layout are predicted.
struct SupportCells {
  View<const std::int64_t, 1> cells;  // (K,) the cells of the image
  const numeric::BucketGrid& grid;    // of their centers, px
};

// Assignments of L cells without a number to U cells of the layout.
struct CellAssignments {
  View<const std::int64_t, 1> candidate;  // (L,) the cells of the image that have no number
  Array<std::int32_t, 1> place;           // (L,) the cell of the layout that each would be, or -1
  Array<bool, 1> is_evaluated;            // (L,) `place` is known, or need not be
  Array<double, 1> gap;  // (L,) the distance from the next numbered cell, in cells; infinite for a
                         // cell numbered meanwhile
  Array<double, 1> support_radius2;  // (L,) px^2, the squared distance of the farthest support cell of those
                                     // evaluated: a nearer new number changes the assignment
  Array<std::int32_t, 1> candidate_count;  // (U,) how many cells are assigned to each cell of the layout
};

// Assignments of the cells `candidate` (L,) to `places` cells of the layout, before any evaluation.
CellAssignments empty_assignments(View<const std::int64_t, 1> candidate, Index places);

// Withdraws assignments to occupied cells of the layout, and those that newly numbered cells may change.
//
// center (N, 2) px; new_cells, the cells of the image numbered since the last update.
void update_outdated_assignments(View<const double, 2> center, View<const std::int64_t, 1> new_cells,
                                 const PartialNumbering& numbering, CellAssignments& assignments);

// Assigns the cells nearest to numbered ones, and their possible rivals, until it is clear which are numbered
// next.
//
// The gap, in cells, up to which unique assignments become numbers in this round.
double update_assignments(const ClaimedCells& scene, const SupportCells& support,
                          const PartialNumbering& numbering, CellAssignments& assignments);

}  // namespace cmp::numbering
