// The corners of a small pattern's cells where their numbers predict them.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/lattice_tables.hpp"
#include "localmap/affine_maps.hpp"

namespace cmp::numbering {

// (N, 3, 2) px, the numbered cells' corners by the neighbours' centers, clockwise; (N,), which are known.
//
// center_px (N, 2); cell (N,), the layout's cell of each cell of the image, or -1; mirrored, seen from the
// back.
std::tuple<Array<double, 3>, Array<bool, 1>> predicted_corners(View<const double, 2> center_px,
                                                               View<const std::int32_t, 1> cell,
                                                               const layout::LayoutCells& layout,
                                                               bool mirrored,
                                                               const localmap::AffineMapLimits& limits);

}  // namespace cmp::numbering
