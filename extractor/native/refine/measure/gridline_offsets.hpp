// Offsets of the gridlines at virtual markers, measured where refinement last compared the image with the
// pattern.
//
// Rounded corners, halos and inks whose response differs shift the sides of all cells alike, by an amount
// that depends on the ink and on the place along the side: its profile. A profile is no shape of the surface,
// as colored cells lie on alternate sides of the gridlines. The median profile of each ink over the picture
// is removed from the offsets.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

// Limits of the offsets.
struct OffsetLimits {
  // of the squared weights of pixels at a virtual marker, in units of the squared contrast. Chosen.
  double min_weight_sum = 0.08;
  double min_offset_weight = 0.4;  // of a gridline, for its offsets to be measured. Chosen.
  // of an ink; with no more, its profile is taken as 0. Chosen, as for the dot gain.
  Index min_profile_gridlines = 40;
};

// The gridlines and the levels beside them, where refinement last compared the image with the pattern.
struct GridlineReading {
  View<const double, 2> lines;            // (E, 8), as gridlines gives them
  View<const double, 2> contrasts;        // (E, 3) gray levels, as value_contrasts gives them
  View<const double, 3> station_sums;     // (E, m, 2), as accumulate_station_sums gives them
  View<const double, 1> weight;           // (E,) 0 to 1
  View<const double, 1> variance_ratio;   // (E,), as variance_ratios gives it
  View<const double, 1> dot_gain_offset;  // (E,) px, the shift of the gridline towards (-uy, ux) by dot gain
  View<const double, 1> ink_offset;    // (E,) px, towards (-uy, ux), from the stated gridline to the seen one
  View<const double, 1> ink_variance;  // (E,) px^2, of the stated gridline, which covers the seen one
  double sigma;                        // px, the blur
  double noise;                        // gray levels

  CMP_RECORD("extractor.refine.estimate.GridlineReading", lines, contrasts, station_sums, weight,
             variance_ratio, dot_gain_offset, ink_offset, ink_variance, sigma, noise)
};

// The offsets of the gridlines around their m virtual markers.
//
// (E, m, 2): px, the offset towards (-uy, ux) less that of dot gain and of the ink's profile; px^2, its
// variance. NaN where the gridline has no contrast or little weight or leaves the image.
Array<double, 3> measure_offsets(const GridlineReading& reading, const OffsetLimits& limits);

// (E, m, 3) the virtual markers: x and y, px at full scale, and the variance across the gridline, px^2; NaN
// where not measured.
//
// scale, full-scale pixels per pixel.
Array<double, 3> virtual_markers(const GridlineReading& reading, double scale, const OffsetLimits& limits);

}  // namespace cmp::refine
