// The warm start: a frame's numbering is predicted from the previous frame, and proved by the image.
//
// The previous frame is no evidence. Every cell must show its own ink inside and none of it across its edges,
// and must be connected to the white cell (or to the whole rim of the pattern) over cells that pass the same
// test. A triangle that is off by more than a seventh of an edge fails. Therefore, where two passing
// triangles share a corner, the real cells share it, too. Around a real corner red, green and blue turn
// clockwise, so a chain of such cells from the white cell has the numbering of a cold start. Frames that fail
// have a cold start. The previous frame thus saves time and does not determine the numbering, except while
// the white cell is hidden and the whole rim is visible.
#pragma once

#include <optional>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "numbering/marker_places.hpp"
#include "refine/first_estimate.hpp"
#include "track/seen_cells.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Limits of the proof.
struct WarmStartLimits {
  double centre_radius_px = 0.5;  // of the disc over which a middle's color is averaged. Chosen.
  // of a middle's ink level, relative to the frame before, for the middle to show its ink. Chosen.
  double min_centre_strength = 0.3;
  // of the cells in view, whose middles must show their ink under a predicted position. Chosen.
  double min_predicted_share = 0.8;
  double min_verified_share = 0.95;  // of the cells in view that the image must confirm. Chosen.
  // in edges; after a larger shift the window is moved and the shift measured again. Chosen.
  double large_shift = 0.2;
  // of a cell from the frame before, in edges, up to which the cell rests. Chosen.
  double resting_shift = 0.02;
  // of a cell's three edges across which it is bright, for the white cell and for a rival. Chosen.
  std::int64_t min_white_edges = 2;
  CellLimits cells;
};

// The last frame; the Python class explains the fields.
struct TrackState {
  View<const double, 2> xy_px;  // (M, 2)
  View<const bool, 1> known;    // (M,)
  std::optional<View<const double, 2>> previous_px;
  SeenCells cells;
  refine::KnownAppearance appearance;

  CMP_RECORD("extractor.track.warm_start.TrackState", xy_px, known, previous_px, cells, appearance)
};

// A proved start; the Python class explains the fields.
struct WarmStart {
  numbering::InitialMarkers places;
  SeenCellsArrays cells;
  refine::LevelArrays ink_levels;
  bool by_rim;

  CMP_RECORD("extractor.track.warm_start.WarmStart", places, cells, ink_levels, by_rim)
};

// The start from the last frame, in an image at the scale of the check; nothing where it does not prove one.
std::optional<WarmStart> warm_start(const image::PyramidLevel& view, const TrackState& state,
                                    const WarmTables& tables, const WarmStartLimits& limits);

}  // namespace cmp::track
