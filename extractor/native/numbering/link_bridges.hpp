// Links without which two parts of the mesh would not hang together.
#pragma once

#include "numbering/lattice_walk.hpp"

namespace cmp::numbering {

// (N,) the parts of cells that hang together without bridges, or -1 for a cell alone. A bridge is a link in
// no loop.
Array<std::int32_t, 1> parts_without_bridges(const CellLinks& links, View<const std::int32_t, 1> part);

}  // namespace cmp::numbering
