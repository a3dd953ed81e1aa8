// The sums over the pixels of one gridline.
#pragma once

#include "base/array.hpp"
#include "refine/synthesis/pixel_weights.hpp"

namespace cmp::refine {

// Adds `count` pixels, from the values of the image and of the drawn light, to a gridline's sums (24,), and
// fills in their columns that accumulate_bending_sums reads.
//
// bleed: the light whose added part is the change of the levels by the blur.
void accumulate_sums(const SideLight& light, const SideLight& bleed, Index count, GridlinePixels& pixels,
                     View<double, 1> sums);

// Adds the same pixels to the sums of the gridline's bending, with the weights t (1 - t) and t (1 - t) (1 - 2
// t).
void accumulate_bending_sums(const GridlinePixels& pixels, Index count, View<double, 1> sums);

}  // namespace cmp::refine
