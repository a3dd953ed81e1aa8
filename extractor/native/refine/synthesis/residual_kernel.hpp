// The residual, image minus drawn pattern (pattern_drawing), summed along the gridlines.
//
// The weight of a pixel is the derivative of the drawing by the gridline's offset. That derivative falls
// towards the gridline's two ends as 1 - t and t. The sums are the gradient of the log-likelihood and its
// curvature.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

// columns of the sums over a gridline's pixels
inline constexpr Index AA = 0, AB = 1, BB = 2, A = 3, B = 4, MISFIT = 5, PIXELS = 6, BLUR = 7,
                       BLUR_CURVATURE = 8, A_BLUR = 9, B_BLUR = 10;
inline constexpr Index AC = 11, AD = 12, BC = 13, BD = 14, CC = 15, CD = 16, DD = 17, C = 18, D = 19,
                       C_BLUR = 20, D_BLUR = 21;
inline constexpr Index READ_AA = 22,
                       READ_BB = 23;  // AA and BB as read, where bending is eliminated from them
inline constexpr Index SUMS = 24;

// Gridlines as they are drawn.
struct DrawnGridlines {
  View<const double, 2> lines;     // (E, 8), as gridlines gives them
  View<const double, 2> sides;     // (E, 6), the light on both sides, as GridlineSides gives it
  View<const double, 2> added;     // (E, 6), the light to add: the black, and the change of the levels since
  View<const double, 2> bleed;     // (E, 6), the change of the light where the blur grows by its own width
  View<const bool, 1> is_bending;  // (E,), gridlines with two more unknowns for their bending
};

// The sums along gridlines.
struct ResidualSums {
  Array<double, 2> ends;  // (E, 24), by the offsets of both ends; the columns are named above
  Array<double, 3>
      stations;  // (E, m, 2), at the stations of each gridline, as accumulate_station_sums gives them
};

// The sums over the pixels near each gridline, and around `stations` stations of each.
//
// model (H, W, 3), the light of the drawn pattern over black; sigma px, the blur; box (4,) px, x from, y
// from, x to, y to: the drawn part of the image. AA, AB, BB: squared derivatives of the drawing's values by
// the gridline's offset at both ends; A, B: derivative times residual (image less drawing, both as values);
// MISFIT: squared residual of PIXELS; BLUR: residual times the derivative by sigma; BLUR_CURVATURE, A_BLUR,
// B_BLUR: that derivative squared, and times those by the offsets. C and D are the same for the bending of
// gridlines that bend, 0 elsewhere.
ResidualSums accumulate_residual_sums(const image::PyramidLevel& view, View<const float, 3> model,
                                      const DrawnGridlines& drawn, double sigma,
                                      View<const std::int64_t, 1> box, Index stations,
                                      const PixelRowLimits& limits);

}  // namespace cmp::refine
