// What a frame shows of a pattern's cells, for the next frame of the sequence.
#pragma once

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "track/image_check.hpp"
#include "track/ink_alignment.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Limits of all that is read of the cells.
struct CellLimits {
  CheckLimits check;
  AlignmentLimits alignment;
};

// What a frame shows of its C cells; the Python class explains the fields.
struct SeenCells {
  View<const double, 3> levels;  // (2, C, 3)
  View<const double, 2> light;   // (2, 3)
  View<const double, 2> ink_px;  // (C, 2)

  CMP_RECORD("extractor.track.warm_start.SeenCells", levels, light, ink_px)
};

// The same, with memory of its own.
struct SeenCellsArrays {
  Array<double, 3> levels;
  Array<double, 2> light, ink_px;

  CMP_RECORD("extractor.track.warm_start.SeenCells", levels, light, ink_px)
};

// (2, 3) the mean light of cells over black, and of their black, from levels (2, C, 3) of 0 to 255; light
// (256,) of the values, which is a straight line between two values.
Array<double, 2> mean_light(View<const double, 3> levels, View<const float, 1> light);

// What an image shows of the cells of numbered markers xy_px (M, 2). Cells that are not seen have the mean
// levels of their ink. view is the image at the scale of the next check.
SeenCellsArrays seen_cells(const image::PyramidLevel& view, View<const double, 2> xy_px,
                           const WarmTables& tables, const CellLimits& limits);

}  // namespace cmp::track
