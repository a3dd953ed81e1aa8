// The topology of a layout: which edges, cells and neighbours belong to each other.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

inline constexpr Index SPOKES = 6;  // edges that end at a marker, at most

// Tables of M markers, E edges, K drawn cells (the colored ones and the white one) and B black cells; -1:
// none.
struct Topology {
  static constexpr bool is_lasting = true;  // read once, as base/binding.hpp says
  View<const std::int32_t, 2> edges;        // (E, 2) marker ids, the smaller first
  View<const std::int32_t, 2> cells;        // (K, 3) marker ids of the drawn cells
  View<const std::int32_t, 1> cell_color;   // (K,) red 0, green 1, blue 2, white 4
  View<const std::int32_t, 2> cell_edges;   // (K, 3), edge k connects the corners k and k + 1
  View<const std::int32_t, 2> black_cells;  // (B, 3) marker ids of the black cells
  View<const std::int32_t, 2> edge_cells;   // (E, 2) the drawn cells on the two sides of an edge, in no order
  View<const std::int32_t, 2> spokes;  // (M, 6) the edges that end at a marker, in the order of directions
  // (M, 18) the markers in the two rings around, the first ring first
  View<const std::int32_t, 2> ring_markers;
  View<const double, 3> ring_vectors;  // (M, 18, 2) from a marker to these, in units of the mean edge, y up
  View<const double, 3> derivative_stencil;  // (M, 18, 5) weights that give the map's derivatives, else 0
  View<const double, 2> edge_vectors;        // (E, 2) from an edge's start to its end, in the same unit
  // (E, 2) on the same gridline, the marker before an edge's start and the one after its end
  View<const std::int32_t, 2> next_markers;
  View<const double, 2> third_differences;  // (E, 2) the layout's third difference along these four markers
  View<const std::int32_t, 2> next_edges;   // (M, 6) the edge that follows each spoke on the same gridline
  // (E, 6) how a gridline moves with its start, its end and the other end, relative to a straight line: three
  // by tangents, three by second derivatives
  View<const double, 2> end_couplings;
  View<const double, 2> covariance_couplings;  // (E, 6) the same of the covariances
  // (E, 3) of a gridline's b, over the variance of the scatter: its variance with the map's tangents, its
  // covariance with, and the variance of, that with second derivatives
  View<const double, 2> scatter_bending;

  CMP_RECORD("extractor.layout.topology.Topology", edges, cells, cell_color, cell_edges, black_cells,
             edge_cells, spokes, ring_markers, ring_vectors, derivative_stencil, edge_vectors, next_markers,
             third_differences, next_edges, end_couplings, covariance_couplings, scatter_bending)
};

}  // namespace cmp::layout
