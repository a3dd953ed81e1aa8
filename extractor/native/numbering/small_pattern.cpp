#include "numbering/small_pattern.hpp"

#include <cmath>
#include <limits>

namespace cmp::numbering {

std::tuple<Array<double, 3>, Array<bool, 1>> predicted_corners(View<const double, 2> center_px,
                                                               View<const std::int32_t, 1> cell,
                                                               const layout::LayoutCells& layout,
                                                               bool mirrored,
                                                               const localmap::AffineMapLimits& limits) {
  const auto image_cell = localmap::image_cell_of_layout_cell(cell, layout.ink.size());
  const auto slope = localmap::linear_maps(center_px, cell, image_cell, layout, limits);
  Array<double, 3> corners({cell.size(), 3, 2}, std::numeric_limits<double>::quiet_NaN());
  Array<bool, 1> good({cell.size()}, false);
  // clockwise in the image a cell's corners run 0, 2, 1, from the back 0, 1, 2
  const int corner_step = mirrored ? 1 : 2;
  for (Index i = 0; i < cell.size(); ++i) {
    if (cell[i] < 0 || std::isnan(slope(i, 0, 0))) continue;
    good[i] = true;
    for (int k = 0; k < 3; ++k) {
      const auto vector_mm = layout.corner_vectors_mm[cell[i]][corner_step * k % 3];
      for (int axis = 0; axis < 2; ++axis)
        corners(i, k, axis) =
            center_px(i, axis) + slope(i, axis, 0) * vector_mm[0] + slope(i, axis, 1) * vector_mm[1];
    }
  }
  return {std::move(corners), std::move(good)};
}

}  // namespace cmp::numbering
