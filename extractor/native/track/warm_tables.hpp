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

  CMP_RECORD("extractor.track.warm_tables.WarmTables", corners, ink, across_edge, nearest)
};

// The markers xy (M, 2), px; those that are NaN are predicted from known cells across one of their edges.
//
// completion (K, 4), weights (K, 3): d = weights . (a, b, c); the mean of all predictions of a marker.
Array<double, 2> predict_missing(View<const std::int32_t, 2> completion, View<const double, 2> weights,
                                 View<const double, 2> xy);

}  // namespace cmp::track
