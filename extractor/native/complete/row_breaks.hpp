// Jumps of gridlines by strips of an image, which show a break of the image along a row.
#pragma once

#include "layout/topology.hpp"

namespace cmp::complete {

// Limits of jumps. Lengths are in median edges, unless stated otherwise.
struct JumpLimits {
  double bin = 1.0 / 3.0;          // height of the strips of rows. Chosen.
  std::int64_t min_gridlines = 6;  // that cross a strip. Chosen.
  // a third of the layout's own third difference, for a gridline to count. Chosen: a tilted view maps it a
  // tenth wrong.
  double most_of_layout = 0.06;
  double min_rise = 0.6;  // of a gridline across the rows, to count. Chosen.
  // times the median squared distance of the jumps of a strip from their median, that is taken off its
  // square: all gridlines across a break jump alike, beside dirt and in a contact they do not. Chosen: with 2
  // and with 4 the same tears are found, and none in pictures with dirt, glare or contact.
  double disagreement = 2.0;
  double min_jump = 0.02;  // of a strip, for a break. Chosen: 0.4 px where an edge has 20.
  // of the largest jump along rows and that along columns, for a break. Chosen: pressed and twisted patterns
  // have less than 2.
  double ratio = 3.0;
  // the same two limits of the RMS over all strips: where all rows are displaced, some gridlines of the same
  // picture jump along columns, too. Chosen: pictures with dirt, glare, motion blur and scattered markers
  // reach 0.03, or 2.1, but not both.
  double min_usual_jump = 0.03, usual_ratio = 2.0;
};

// The jumps of an image; the Python class explains them.
struct StripJumps {
  double edge_px;
  Array<double, 1> rows_px;  // (B,)
  double largest_px;
  bool is_broken;

  CMP_RECORD("extractor.complete.row_breaks.StripJumps", edge_px, rows_px, largest_px, is_broken)
};

// xy (M, 2) px, NaN where not measured.
StripJumps measure_jumps(View<const double, 2> xy, const layout::Topology& topology,
                         const JumpLimits& limits);

}  // namespace cmp::complete
