// Measures the inks, and the brightness and whiteness of predicted places.
#pragma once

#include "base/array.hpp"

namespace cmp::numbering {

// Limits of whiteness; explained in extractor/numbering/whiteness.py.
struct WhitenessLimits {
  double sample_radius;

  template <class F>
  static WhitenessLimits read(const F& f) {
    return {f["sample_radius"]};
  }
};

// The inks in the image.
struct InkColors {
  View<const double, 2>
      colors;  // (4, 3) median BGR of red, green and blue in rows 1 to 3; 0 for an absent ink
  View<const double, 1> strongest;  // (3,) the maximum of each channel
};

// The same with memory of its own, and the K cells that were measured.
struct MeasuredInks {
  Array<double, 1> radius_px;  // (K,) over which the cell's color is sampled
  Array<double, 1> level;      // (K,) the sum of its channels, NaN outside the image
  Array<double, 2> colors;     // (4, 3) as in InkColors
  Array<double, 1> strongest;  // (3,) as in InkColors
};

// The colors of P predicted places.
struct PlaceColors {
  Array<double, 1> brightness;  // (P,) relative to the inks
  Array<double, 1> whiteness;   // (P,) the weakest channel, relative to the strongest ink of that channel
  Array<double, 2> color;       // (P, 3) BGR, 0 outside the image
};

// The levels of known cells, and the colors of the inks.
//
// image (H, W, 3) BGR without gaps; center (N, 2) px; area (N,) px^2; ink (N,) of the cells of the image;
// known (K,), the cells that are measured.
MeasuredInks measure_inks(View<const std::uint8_t, 3> image, View<const double, 2> center,
                          View<const double, 1> area, View<const std::uint8_t, 1> ink,
                          View<const std::int64_t, 1> known, const WhitenessLimits& limits);

// The colors of predicted places.
//
// Far from the next cell a prediction may hit a colored cell: there the brightness is the whiteness.
//
// image (H, W, 3) BGR without gaps; means (P, 4) of the predicted places; strongest (3,) of the inks;
// is_far, no known cell touches the places.
PlaceColors measure_whiteness(View<const std::uint8_t, 3> image, View<const double, 2> means,
                              View<const double, 1> strongest, bool is_far);

}  // namespace cmp::numbering
