// The pixels near a marker, which the gridlines that meet there share.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

struct GridlineSystem;

inline constexpr Index CLOSED_FORM_TERMS = 9;

// Limits of shared pixels; explained in extractor/refine/solve/shared_pixels.py.
struct SharedPixelLimits {
  double max_cosine, min_end_information, min_uncut_information;
  std::array<double, CLOSED_FORM_TERMS> plain_form, linear_form;

  template <class F>
  static SharedPixelLimits read(const F& f) {
    return {f["max_cosine"], f["min_end_information"], f["min_uncut_information"], f["plain_form"],
            f["linear_form"]};
  }
};

// Adds the information of shared pixels to the matrix: diagonal (M, 3) and off_diagonal (E, 4), 1/px^2,
// written.
void add_shared_pixels(const GridlineSystem& system, View<double, 2> diagonal, View<double, 2> off_diagonal,
                       const SharedPixelLimits& limits);

}  // namespace cmp::refine
