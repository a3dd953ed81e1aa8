// Tables of a layout for the warm start, and markers from neighbouring cells.
#pragma once

#include "base/array.hpp"

namespace cmp::track {

// The layout's cell across an edge; twins of the constants in extractor/track/warm_tables.py.
inline constexpr std::uint8_t NO_CELL = 0, BLACK_CELL = 1, WHITE_CELL = 2;

// The C colored cells of a triangular layout.
struct WarmTables {
  View<const std::int32_t, 2> corners;      // (C, 3) marker ids, counter-clockwise from the front
  View<const std::uint8_t, 1> ink;          // (C,) 1 red, 2 green, 3 blue
  View<const std::uint8_t, 2> across_edge;  // (C, 3) the kind of cell across the edge from corner k to k + 1
  View<const std::int32_t, 2> nearest;      // (C, 3) the nearest red, green and blue cell
  View<const std::int32_t, 2> cells_of_marker;  // (M, 3) the colored cells around a marker, or -1
  View<const bool, 1> is_at_white, is_rim;      // (C,) beside the white cell; with a corner at the rim
  View<const std::int32_t, 2> completion;       // (K, 4) two cells abc and bad with the common edge a-b
  View<const double, 2> completion_weights;     // (K, 3) d = weights . (a, b, c)

  CMP_RECORD("extractor.track.warm_tables.WarmTables", corners, ink, across_edge, nearest, cells_of_marker,
             is_at_white, is_rim, completion, completion_weights)
};

// (C, 3, 2) the corners of cells (C, 3) at markers xy (M, 2).
Array<double, 3> corners_at(View<const double, 2> xy, View<const std::int32_t, 2> corners);

// The markers xy (M, 2), px; those that are NaN are predicted from known cells across one of their edges.
//
// A marker that several cells predict is placed at the mean of these places.
Array<double, 2> predict_missing(const WarmTables& tables, View<const double, 2> xy);

}  // namespace cmp::track
