// Room "numbering" for Python.
#include "base/binding.hpp"

#include "numbering/lattice_walk.hpp"
#include "numbering/marker_places.hpp"
#include "numbering/mesh_parts.hpp"
#include "numbering/outline_fit.hpp"
#include "numbering/pad_code.hpp"
#include "numbering/small_pattern.hpp"
#include "numbering/white_search.hpp"

namespace cmp::numbering {

void add_numbering(nb::module_ module) {
  bind<&faces_by_component>(module, "faces_by_component", {"neighbours", "orientation"});
  bind<&marker_turn_by_brightness>(module, "marker_turn_by_brightness",
                                   {"image", "center", "faces", "orientation", "limits"});
  bind<&walk_component>(
      module, "walk_component",
      {"center", "faces", "neighbours", "orientation", "component", "front", "reach", "limits"});
  bind<&count_meshed_cells>(module, "count_meshed_cells", {"faces", "orientation", "count"});
  bind<&align>(module, "align", {"axial", "layout_axial", "cell_lookup", "limits"});
  bind<&search_white_cell>(module, "search_white_cell", {"image", "cells", "axial", "layout", "limits"});
  bind<&predicted_corners>(module, "predicted_corners",
                           {"center_px", "cell", "layout", "mirrored", "limits"});
  bind<&merge_corners>(module, "merge_corners",
                       {"cells", "numbers", "layout", "corner_ids", "markers", "limits"});
  bind<&code_motions>(module, "code_motions",
                      {"axial", "bit", "board", "least_inside", "are_inks_known", "most"});
}

}  // namespace cmp::numbering
