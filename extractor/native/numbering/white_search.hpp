// Searches the white cell, which fixes the rotation and the origin of a numbering.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "localmap/cell_prediction.hpp"
#include "numbering/white_cell.hpp"
#include "numbering/whiteness.hpp"

namespace cmp::numbering {

// Limits of the search; explained in extractor/numbering/white_search.py.
struct WhiteSearchLimits {
  double min_white_ratio;
  Index max_white_candidates;
  double min_weakest_channel, min_weakest_channel_far;
  WhiteCellLimits cell;
  localmap::CellPredictionLimits prediction;
  WhitenessLimits whiteness;

  template <class F>
  static WhiteSearchLimits read(const F& f) {
    return {f["min_white_ratio"],
            f["max_white_candidates"],
            f["min_weakest_channel"],
            f["min_weakest_channel_far"],
            f["cell"],
            f["prediction"],
            f["whiteness"]};
  }
};

// The N cells of the image.
struct SearchedCells {
  View<const double, 2> center_px;  // (N, 2)
  View<const std::uint8_t, 1> ink;  // (N,) 1 red, 2 green, 3 blue
  View<const double, 1> area_px;    // (N,) px^2

  template <class F>
  static SearchedCells read(const F& f) {
    return {f["center_px"], f["ink"], f["area_px"]};
  }
};

// P bright places, the brightest first: known, ring, cell (P, N), inside (P,), missing (P,), center_px (P,
// 2), and fits (P,) of _WhiteCandidates.
using WhiteCandidates = std::tuple<Index, Index, Array<std::int32_t, 2>, Array<std::int64_t, 1>,
                                   Array<std::int64_t, 1>, Array<double, 2>, Array<bool, 1>>;

// The bright places of the first ring that holds the white cell.
//
// Places enclosed by three cells are measured as well as possible in ring 0: they are not measured again from
// farther away, nor are the places that were tried.
//
// image (H, W, 3) BGR without gaps; axial (N, 2), UNKNOWN_AXIAL for unknown.
WhiteCandidates search_white_cell(View<const std::uint8_t, 3> image, const SearchedCells& cells,
                                  View<const std::int32_t, 2> axial, const WhiteCellLayout& layout,
                                  const WhiteSearchLimits& limits);

}  // namespace cmp::numbering
