// The pattern drawn as light over black, and the residual along its gridlines.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/synthesis/blur_bleed.hpp"
#include "refine/synthesis/gridline_sides.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/ink_levels.hpp"
#include "refine/synthesis/pattern_drawing.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

// The pattern as it is drawn, as far as a step needs it.
struct Synthesis {
  View<const double, 2> lines;      // (E, 8) the gridlines
  View<const double, 2> bend;       // (E, 2) px, their bending
  View<const double, 2> contrasts;  // (E, 3), as value_contrasts gives them
  View<const double, 2> sums;       // (E, 24), as accumulate_residual_sums gives them
  double sigma;                     // the blur, px

  template <class F>
  static Synthesis read(const F& f) {
    return {f["lines"], f["bend"], f["contrasts"], f["sums"], f["sigma"]};
  }
};

// Limits of the drawing; explained in extractor/refine/drawn_pattern.py.
struct DrawingLimits {
  double blur_step;
  GridlineLimits gridlines;
  InkLevelLimits levels;
  BleedLimits bleed;
  PixelRowLimits rows;
  GridlineWeightLimits weights;

  template <class F>
  static DrawingLimits read(const F& f) {
    return {f["blur_step"], f["gridlines"], f["levels"], f["bleed"], f["rows"], f["weights"]};
  }
};

// lines, sides, contrasts, added, sums, corrected_levels and edge_px of Synthesis; the levels as the fields
// of InkLevels.
using DrawnPattern = std::tuple<Array<double, 2>, Array<double, 2>, Array<double, 2>, Array<double, 2>,
                                Array<double, 2>, LevelArrays, double>;

// Draws the pattern with the levels of its inks into the box (4,) of the picture (H, W, 3), and compares the
// two.
DrawnPattern draw_pattern(const image::PyramidLevel& view, const layout::Topology& topology,
                          View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                          View<const std::int64_t, 1> box, const DrawingLimits& limits);

}  // namespace cmp::refine
