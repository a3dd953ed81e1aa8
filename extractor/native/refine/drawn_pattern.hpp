// The pattern drawn as light over black, and the residual along its gridlines.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/synthesis/blur_bleed.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/ink_levels.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

// Limits of the drawing; explained in extractor/refine/drawn_pattern.py.
struct DrawingLimits {
  double margin_sigma, margin_px, blur_step;
  GridlineLimits gridlines;
  InkLevelLimits levels;
  BleedLimits bleed;
  PixelRowLimits rows;
  GridlineWeightLimits weights;

  template <class F>
  static DrawingLimits read(const F& f) {
    return {f["margin_sigma"], f["margin_px"], f["blur_step"], f["gridlines"],
            f["levels"],       f["bleed"],     f["rows"],      f["weights"]};
  }
};

// The gridlines (E, 8); the light on both sides (E, 6), as GridlineSides gives it; contrasts (E, 3), as
// value_contrasts gives them; the light to add on both sides (E, 6); the sums along the gridlines (E, 24), as
// accumulate_residual_sums gives them; the levels, corrected by the residual in the middles of the cells; and
// the median length of the gridlines, px.
using DrawnPattern = std::tuple<Array<double, 2>, Array<double, 2>, Array<double, 2>, Array<double, 2>,
                                Array<double, 2>, LevelArrays, double>;

// Draws the pattern with the levels of its inks into the box (4,) of the picture (H, W, 3), and compares the
// two.
DrawnPattern draw_pattern(const image::PyramidLevel& view, const layout::Topology& topology,
                          View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                          View<const std::int64_t, 1> box, const DrawingLimits& limits);

}  // namespace cmp::refine
