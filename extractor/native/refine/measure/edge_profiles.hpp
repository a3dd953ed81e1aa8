// Edge profiles: the colors across each gridline as a profile from 1 to 0, and the blur of that profile.
//
// Profiles are read between the corners of a gridline only (matched_filter). They are fast, and safe from a
// start that is a pixel off.
#pragma once

#include <array>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/estimate.hpp"

namespace cmp::refine {

inline constexpr std::size_t BLUR_TABLE = 7;  // entries of the tables of apparent and true blur

// Limits of profiles and of their blur; explained in extractor/refine/measure/edge_profiles.py.
struct EdgeProfileLimits {
  double min_contrast, min_sine, max_reach, max_reach_share, middle_share;
  Index min_blur_gridlines;
  double bilinear_px2;
  std::array<double, BLUR_TABLE> apparent_blur, true_blur;

  template <class F>
  static EdgeProfileLimits read(const F& f) {
    return {f["min_contrast"],    f["min_sine"],      f["max_reach"],
            f["max_reach_share"], f["middle_share"],  f["min_blur_gridlines"],
            f["bilinear_px2"],    f["apparent_blur"], f["true_blur"]};
  }
};

// The space around each gridline, (E, 4): px, the height of the lower cell beside the gridline; the sines of
// the smallest angles at its start and end; gray levels^2, the squared contrast. All 0 where the contrast is
// low.
//
// lines (E, 8), as gridlines gives them; contrasts (E, 3) gray levels, of the values on both sides; xy (M, 2)
// px, the markers; cells (K, 3) marker ids; edge_cells (E, 2) cells on both sides, -1 for none.
Array<double, 2> gridline_clearance(View<const double, 2> lines, View<const double, 2> contrasts,
                                    View<const double, 2> xy, View<const std::int32_t, 2> cells,
                                    View<const std::int32_t, 2> edge_cells, const EdgeProfileLimits& limits);

// px, the median blur (sigma) across the middles of some gridlines; NaN where no gridline can be read.
//
// The integral of f (1 - f) over a profile f of the light is sigma / sqrt(pi). Bilinear samples add to the
// integral, and so does another gridline near the profile: where too few gridlines are isolated, the lower
// quartile of all is taken. lines (E, 8); most, gridlines to read, about.
double profile_blur(const image::PyramidLevel& view, View<const double, 2> lines, const EdgeContrasts& across,
                    Index most, const EdgeProfileLimits& limits);

}  // namespace cmp::refine
