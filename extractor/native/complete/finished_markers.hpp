// What follows refinement: repair, the jumps of the image along its rows, and the image's quality.
#pragma once

#include "complete/image_quality.hpp"
#include "complete/repair.hpp"
#include "complete/row_breaks.hpp"

namespace cmp::complete {

// Limits of all three.
struct FinishLimits {
  RepairLimits repair;
  JumpLimits jumps;
  QualityLimits quality;
};

// The markers after repair, and the figures of their image; the Python class explains the fields.
struct FinishedMarkers {
  RepairedMarkers repaired;
  StripJumps jumps;
  CellFigures cells;
  double noise, edge_px;
  bool are_all_measured;

  CMP_RECORD("extractor.complete.finished_markers.FinishedMarkers", repaired, jumps, cells, noise, edge_px,
             are_all_measured)
};

// view, the full image; cells, at which its quality is measured. The markers are in the plane of the black,
// as far as the image's parallax is known.
FinishedMarkers finish_markers(const image::PyramidLevel& view, const RefinedMarkers& refined,
                               const refine::StartPlaces& places, const layout::RingTables& tables,
                               const layout::Topology& topology, const SampledCells& cells,
                               const FinishLimits& limits);

}  // namespace cmp::complete
