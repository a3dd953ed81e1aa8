// Tables of a triangular layout for numbering and repair: cells by lattice place, neighbours of markers and
// cells.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

// The axial coordinate of a cell that has none; as in extractor/layout/lattice_tables.py.
inline constexpr std::int32_t UNKNOWN_AXIAL = -(1 << 20);

// The layout's U colored cells.
struct LayoutCells {
  static constexpr bool is_lasting = true;  // read once, as base/binding.hpp says
  View<const double, 2> centre_mm;          // (U, 2) layout frame
  View<const std::uint8_t, 1> ink;          // (U,) 1 red, 2 green, 3 blue
  View<const double, 1> size_mm;            // (U,) the mean side
  View<const double, 3> corner_vectors_mm;  // (U, 3, 2) from the centre to the corners
  View<const std::int32_t, 2>
      cell_neighbours;  // (U, 6) cells that share a corner, by NEIGHBOUR_STEPS; -1 for none

  CMP_FIELDS(centre_mm, ink, size_mm, corner_vectors_mm, cell_neighbours)
};

// The neighbours of the layout's M markers; -1 for no neighbour.
struct RingTables {
  static constexpr bool is_lasting = true;  // read once, as base/binding.hpp says
  View<const double, 2> marker_mm;          // (M, 2) layout frame
  View<const std::int32_t, 2> neighbours;   // (M, 18) the markers in the two rings around each marker
  View<const double, 2> ring_weights;       // (M, 18) weights of these that give a marker's place, or 0
  View<const std::int32_t, 2> first_ring;   // (M, 6) the six markers around each marker
  View<const bool, 1> present;              // (M,) the markers that touch a colored or white cell
  Index layers;

  CMP_FIELDS(marker_mm, neighbours, ring_weights, first_ring, present, layers)
};

// The layout's cell at the axial (q, r) in the table (S, S), or -1; branch-free, because cells are read in
// any order.
inline std::int32_t cell_at(View<const std::int32_t, 2> cell_lookup, Index q, Index r) {
  const Index last = cell_lookup.size() - 1, middle = last / 2;
  return cell_lookup(std::min(std::max<Index>(q + middle, 0), last),
                     std::min(std::max<Index>(r + middle, 0), last));
}

// (N,) the layout's cell at each axial (q, r) of (N, 2), or -1; cell_lookup (S, S).
Array<std::int32_t, 1> cells_at(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> cell_lookup);

// (N, 3) ids of the markers (q, r), (q + 1, r), (q, r + 1), the corners of the cells at (q, r) of (N, 2).
Array<std::int32_t, 2> corner_ids(View<const std::int32_t, 2> axial);

}  // namespace cmp::layout
