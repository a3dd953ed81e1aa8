// Edge profiles: the colors across each gridline as a profile from 1 to 0, and the blur of that profile.
//
// Profiles are read between the corners of a gridline only (matched_filter). They are fast, and safe from a
// start that is a pixel off.
#pragma once

#include <array>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/measure/matched_filter.hpp"

namespace cmp::refine {

inline constexpr std::size_t BLUR_TABLE = 7;  // entries of the tables of apparent and true blur

// Limits of profiles and of their blur.
struct EdgeProfileLimits {
  double min_contrast = 12.0;  // gray levels; a gridline with less is not read. Chosen.
  double min_sine = 0.05;      // of the angles at a gridline's ends, at least. Chosen.
  // of the cell's height, the reach of a profile to each side. Derived: as in MatchedFilterLimits.
  double max_reach = MatchedFilterLimits{}.max_reach;
  // of the distance to the next gridline, the reach of a blur profile; 0.41 in a regular cell. Chosen.
  double max_reach_share = 0.45;
  double middle_share = 0.4;      // of the gridline, from its ends to the nearest of the profiles. Chosen.
  Index min_blur_gridlines = 12;  // clear of other gridlines, below which all gridlines are taken. Chosen.
  // px^2, mean variance that bilinear sampling adds to the blur. Derived: the mean of f (1 - f) over the
  // fractions f of a pixel.
  double bilinear_px2 = 1.0 / 6;
  // in units of the cell's height, one for the other. Wide blur mixes the neighbours' inks into the middles
  // that the contrasts are taken from, which makes profiles look too steep (rendered honeycombs). The native
  // code has room for as many. Measured on these, by no command that is kept.
  std::array<double, BLUR_TABLE> apparent_blur = {0.0, 0.092, 0.112, 0.128, 0.137, 0.149, 0.154};
  // for each apparent blur. Measured likewise.
  std::array<double, BLUR_TABLE> true_blur = {0.0, 0.093, 0.117, 0.14, 0.16, 0.195, 0.225};
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
