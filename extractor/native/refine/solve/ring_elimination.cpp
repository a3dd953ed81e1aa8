#include "refine/solve/ring_elimination.hpp"

namespace cmp::refine {

namespace {

using Block = std::array<double, 3>;  // xx, xy, yy

// (M, 6): the marker at the other end of each edge, -1 where the edge has no information.
Array<std::int32_t, 2> neighbour_markers(View<const double, 2> off_diagonal,
                                         View<const std::int32_t, 2> edges,
                                         View<const std::int32_t, 2> spokes) {
  Array<std::int32_t, 2> out(spokes.shape(), -1);
  const auto neighbours = out.view();
  for (Index m = 0; m < spokes.size(0); ++m) {
    for (Index k = 0; k < spokes.size(1); ++k) {
      const Index e = spokes(m, k);
      if (e >= 0 && (off_diagonal(e, 0) != 0.0 || off_diagonal(e, 3) != 0.0))
        neighbours(m, k) = edges(e, 0) + edges(e, 1) - static_cast<std::int32_t>(m);
    }
  }
  return out;
}

// Writes an edge's block (4,) into four rows, from its first to its second marker if `forward`.
void fill_block(RingLanes::Row* rows, Index lane, View<const double, 1> block, bool forward) {
  rows[0][lane] = block[0];
  rows[1][lane] = block[forward ? 1 : 2];
  rows[2][lane] = block[forward ? 2 : 1];
  rows[3][lane] = block[3];
}

void fill_own_block(RingLanes::Row* rows, Index lane, const Block& block) {
  for (Index c = 0; c < 3; ++c) rows[c][lane] = block[c];
}

void add_loss(Block& block, View<const double, 3> losses, Index e, Index side) {
  for (Index c = 0; c < 3; ++c) block[c] += losses(e, side, c);
}

}  // namespace

EliminationBlocks prepare_elimination(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                                      View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes) {
  Array<double, 3> losses({edges.size(), 2, 3});
  Array<double, 2> remainders(diagonal);
  const auto loss = losses.view();
  const auto remainder = remainders.view();
  for (Index e = 0; e < edges.size(); ++e) {
    const double b0 = off_diagonal(e, 0), b3 = off_diagonal(e, 3);
    double b1 = off_diagonal(e, 1), b2 = off_diagonal(e, 2);
    for (Index side = 0; side < 2; ++side) {
      const Index n = edges(e, side), p = edges(e, 1 - side);
      const double px = diagonal(p, 0), pxy = diagonal(p, 1), py = diagonal(p, 2);
      const double inverse = 1.0 / (px * py - pxy * pxy);
      const double xx = (py * b0 * b0 - 2 * pxy * b0 * b1 + px * b1 * b1) * inverse;
      const double xy = (py * b0 * b2 - pxy * (b0 * b3 + b1 * b2) + px * b1 * b3) * inverse;
      const double yy = (py * b2 * b2 - 2 * pxy * b2 * b3 + px * b3 * b3) * inverse;
      loss(e, side, 0) = xx;
      loss(e, side, 1) = xy;
      loss(e, side, 2) = yy;
      remainder(n, 0) -= xx;
      remainder(n, 1) -= xy;
      remainder(n, 2) -= yy;
      std::swap(b1, b2);
    }
  }
  auto neighbours = neighbour_markers(off_diagonal, edges, spokes);
  return {off_diagonal, edges, spokes, std::move(losses), std::move(remainders), std::move(neighbours)};
}

void fill_ring(Index m, Index lane, const EliminationBlocks& matrix, RingLanes& ring) {
  const auto off_diagonal = matrix.off_diagonal;
  const auto edges = matrix.edges, spokes = matrix.spokes, neighbours = matrix.neighbours.view();
  const auto losses = matrix.losses.view();
  const auto remainders = matrix.remainders.view();
  std::array<Index, RING> markers, ring_edges;
  std::array<Block, RING> blocks;
  Index count = 0;
  for (Index i = 0; i < RING; ++i) {
    const Index n = neighbours(m, i), e = spokes(m, i);
    if (n < 0) continue;
    const Index side = edges(e, 0) == m ? 1 : 0;
    markers[count] = n;
    ring_edges[count] = e;
    blocks[count] = {remainders(n, 0), remainders(n, 1), remainders(n, 2)};
    add_loss(blocks[count], losses, e, side);
    ++count;
  }
  const Index last = count - 1;
  for (Index i = 0; i < (count > 2 ? count : last); ++i) {
    const Index j = i < last ? i + 1 : 0;
    Index e = -1;
    for (Index c = 0; c < RING; ++c) {
      if (neighbours(markers[i], c) == markers[j]) e = spokes(markers[i], c);
    }
    if (e < 0) continue;
    const Index side = edges(e, 0) == markers[i] ? 0 : 1;
    add_loss(blocks[i], losses, e, side);
    add_loss(blocks[j], losses, e, 1 - side);
    if (j == 0) {
      fill_block(&ring.rows[TO_LAST], lane, off_diagonal[e], side == 1);
    } else {
      fill_block(&ring.rows[NEIGHBOUR_ROWS * i + (j == last ? TO_LAST : TO_NEXT)], lane, off_diagonal[e],
                 side == 0);
    }
  }
  for (Index i = 0; i < last; ++i) {
    RingLanes::Row* const rows = &ring.rows[NEIGHBOUR_ROWS * i];
    fill_own_block(rows + OWN, lane, blocks[i]);
    fill_block(rows + TO_MIDDLE, lane, off_diagonal[ring_edges[i]], edges(ring_edges[i], 1) == m);
  }
  if (count == 0) return;
  fill_own_block(&ring.tail[LAST], lane, blocks[last]);
  fill_block(&ring.tail[LAST_TO_MIDDLE], lane, off_diagonal[ring_edges[last]],
             edges(ring_edges[last], 1) == m);
}

}  // namespace cmp::refine
