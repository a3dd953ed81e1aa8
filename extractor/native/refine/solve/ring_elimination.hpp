// Elimination of a marker's neighbours, one after the other, for many markers at once.
//
// Going round the marker, a neighbour is joined to the next one and to the marker; the first one also to the
// last. So the neighbour that is eliminated next is never joined to any other.
#pragma once

#include "base/array.hpp"
#include "refine/solve/ring_lanes.hpp"

namespace cmp::refine {

// The information matrix, prepared for the elimination of the markers around each marker.
struct EliminationBlocks {
  View<const double, 2> off_diagonal;  // (E, 4) 1/px^2, as in Information
  View<const std::int32_t, 2> edges;   // (E, 2), as in Topology
  View<const std::int32_t, 2> spokes;  // (M, 6), as in Topology
  Array<double, 3> losses;  // (E, 2, 3) 1/px^2, what the block at each end of an edge loses as xx, xy, yy
                            // when the marker at the other end is eliminated
  Array<double, 2>
      remainders;  // (M, 3) 1/px^2, the markers' blocks less the losses by all of their neighbours
  Array<std::int32_t, 2> neighbours;  // (M, 6) the marker at the other end of each spoke, -1 where that edge
                                      // has no information
};

// The blocks of an information matrix; all markers of edges (E, 2) must have a positive definite block.
EliminationBlocks prepare_elimination(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                                      View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes);

// Writes the neighbours of marker m, and the blocks that join them to each other and to the marker, into a
// lane, which must hold zeros.
void fill_ring(Index m, Index lane, const EliminationBlocks& matrix, RingLanes& ring);

}  // namespace cmp::refine
