// The matched filter across the gridlines: rows of pixels are compared with a blurred step.
//
// The weight of a pixel is the derivative of the step, so that the weighted sums give the offset of the
// gridline from its expected place.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"

namespace cmp::refine {

// The change of color across the gridlines.
struct EdgeContrasts {
  View<const double, 2> sides;      // (E, 6) light on both sides, as GridlineSides gives it
  View<const double, 2> contrasts;  // (E, 3) gray levels, differences of the values on both sides
  View<const double, 2> clearance;  // (E, 4), as gridline_clearance gives it

  CMP_RECORD("extractor.refine.estimate.EdgeContrasts", sides, contrasts, clearance)
};

// columns of a gridline's clearance, which the Python module names too
inline constexpr Index HEIGHT = 0, SINE_A = 1, SINE_B = 2, SQUARED_CONTRAST = 3;
inline constexpr Index CLEARANCE_COLUMNS = 4;

// Limits of the rows of pixels across a gridline.
struct MatchedFilterLimits {
  // in units of the blur, the reach of a row to each side. Derived: erf(1.3), 93 % of what a gridline tells,
  // lies within.
  double reach_sigma = 1.3;
  // in units of the blur, the least distance of the other gridline of a corner from a row. Chosen.
  double clear_sigma = 2.6;
  double max_reach = 0.33;  // of the cell's height, the reach of a row at most. Chosen.
  // of the gridline, the part at each end without rows, at least and at most. Chosen.
  double min_end_share = 0.1, max_end_share = 0.4;
  // px, and of the gridline's length; a gridline whose offset exceeds the larger of both is not read. Chosen.
  double min_offset_px = 1.0, max_offset_share = 0.15;
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
