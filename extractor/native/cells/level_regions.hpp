// The regions of a map above a share of its local contrast.
#pragma once

#include <vector>

#include "cells/moments.hpp"
#include "image/contrast_maps.hpp"

namespace cmp::cells {

// The moments of the connected regions (4 neighbours) in which a map exceeds its low level by a share of the
// local contrast, and by at least min_contrast. Only regions of min_area to max_area pixels.
std::vector<MomentSums> level_regions(const image::ContrastMap& map, double share, double min_contrast,
                                      double min_area, double max_area);

}  // namespace cmp::cells
