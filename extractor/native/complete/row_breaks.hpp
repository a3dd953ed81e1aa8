// Jumps of gridlines by strips of an image, which show a break of the image along a row.
#pragma once

#include "complete/virtual_markers.hpp"

namespace cmp::complete {

// Limits of jumps; explained in extractor/complete/row_breaks.py.
struct JumpLimits {
  double bin, most_of_layout, min_rise, disagreement;
  std::int64_t min_gridlines;

  template <class F>
  static JumpLimits read(const F& f) {
    return {f["bin"], f["most_of_layout"], f["min_rise"], f["disagreement"], f["min_gridlines"]};
  }
};

// The median edge, 0 with few edges; the lengths of the median jump of each strip of rows, beyond the
// disagreement of its gridlines, and of each strip of columns, NaN with few gridlines; px.
using StripJumps = std::tuple<double, Array<double, 1>, Array<double, 1>>;

StripJumps measure_jumps(const LocatedMarkers& markers, const layout::Topology& topology,
                         const JumpLimits& limits);

}  // namespace cmp::complete
