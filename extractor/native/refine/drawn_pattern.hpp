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
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

// Limits of the drawing.
struct DrawingLimits {
  // blurs around the pattern that are drawn. Derived: 6e-5 of a blurred edge lies beyond.
  double margin_sigma = 4.0;
  double margin_px = 2.0;   // px, added to that. Chosen.
  double blur_step = 0.02;  // of the blur, for derivatives of the levels. Chosen.
  GridlineLimits gridlines;
  InkLevelLimits levels;
  BleedLimits bleed;
  PixelRowLimits rows;
  GridlineWeightLimits weights;
};

struct DrawnPattern {
  Array<double, 2> lines;      // (E, 8) the gridlines
  Array<double, 2> sides;      // (E, 6) the light on both sides, as GridlineSides gives it
  Array<double, 2> contrasts;  // (E, 3) as value_contrasts gives them
  Array<double, 2> added;      // (E, 6) the light to add on both sides
  ResidualSums sums;           // as accumulate_residual_sums gives them
  LevelArrays corrected;       // the levels, by the residual in the middles of the cells
  double edge_px;              // the median length of the gridlines
};

// Draws the pattern with the levels of its inks into the box (4,) of the picture (H, W, 3), and compares the
// two; also at `stations` stations of each gridline.
DrawnPattern draw_pattern(const image::PyramidLevel& view, const layout::Topology& topology,
                          View<float, 3> picture, const PatternState& state, const InkLevels& levels,
                          View<const std::int64_t, 1> box, Index stations, const DrawingLimits& limits);

}  // namespace cmp::refine
