// The matched filter across the gridlines: rows of pixels are compared with a blurred step.
//
// The weight of a pixel is the derivative of the step, so that the weighted sums give the offset of the
// gridline from its expected place.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/estimate.hpp"

namespace cmp::refine {

// columns of a gridline's clearance, which the Python module names too
inline constexpr Index HEIGHT = 0, SINE_A = 1, SINE_B = 2, SQUARED_CONTRAST = 3;
inline constexpr Index CLEARANCE_COLUMNS = 4;

// Limits of the rows; explained in extractor/refine/measure/matched_filter.py.
struct MatchedFilterLimits {
  double reach_sigma, clear_sigma, max_reach, min_end_share, max_end_share, min_offset_px, max_offset_share;

  template <class F>
  static MatchedFilterLimits read(const F& f) {
    return {f["reach_sigma"],   f["clear_sigma"],   f["max_reach"],       f["min_end_share"],
            f["max_end_share"], f["min_offset_px"], f["max_offset_share"]};
  }
};

// (E, 24) sums over rows of pixels across each gridline, with the columns and units of
// accumulate_residual_sums; 0 where nothing was read.
//
// lines (E, 8), as gridlines gives them; sigma px, the blur; is_bending (E,), gridlines whose bending is
// read, too; most, rows across one gridline, at most.
Array<double, 2> read_profiles(const image::PyramidLevel& view, View<const double, 2> lines,
                               const EdgeContrasts& across, double sigma, View<const bool, 1> is_bending,
                               Index most, const MatchedFilterLimits& limits);

}  // namespace cmp::refine
