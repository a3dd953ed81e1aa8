// Predicts the white cell's place and size from the numbered cells nearest to it.
#pragma once

#include "numbering/white_cell.hpp"

namespace cmp::numbering {

// The image around a cell: its center, px, and px per axial step.
struct AxialMap {
  PlanePoint center;
  double qx, rx, qy, ry;  // x = qx q + rx r, y = qy q + ry r

  // The point of the image at the axial vector (u, v) from the center.
  PlanePoint image_point(double u, double v) const {
    return {center.x + qx * u + rx * v, center.y + qy * u + ry * v};
  }
};

// The map around the white cell, of a quadratic map from layout to image through the numbered cells nearest
// to it.
//
// The center is NaN where the prediction is uncertain. Arguments as of locate_white_cell.
AxialMap predict_white_cell(View<const double, 2> center_px, View<const std::int32_t, 1> cell,
                            const WhiteCellLayout& layout, const WhiteCellLimits& limits);

}  // namespace cmp::numbering
