// Room "numbering" for Python.
#include "base/binding.hpp"

#include "numbering/ink_fields.hpp"
#include "numbering/lattice_walk.hpp"
#include "numbering/marker_places.hpp"
#include "numbering/missing_cells.hpp"
#include "numbering/part_attachment.hpp"
#include "numbering/registration.hpp"

namespace cmp::numbering {

void add_numbering(nb::module_ module) {
  module.attr("BRIGHT") = InkFieldLimits{}.bright;
  module.attr("OUTSIDE_WEIGHT") = WitnessLimits{}.outside_weight;
  bind<&walk_cells>(module, "walk_cells", {"links", "light"});
  bind<&cell_light>(module, "cell_light", {"view", "centre", "corner"});
  bind<&ink_fields>(module, "ink_fields", {"view", "cells", "light", "part"});
  bind<&register_part>(module, "register_part", {"axial", "naming", "white_axial", "white", "layout"});
  bind<&cells_beside>(module, "cells_beside", {"axial", "down_axial"});
  bind<&moved_cells>(module, "moved_cells", {"cells", "part", "motion", "cell_lookup"});
  bind<&attach_parts>(module, "attach_parts",
                      {"cells", "cell", "odds", "layout", "axial", "cell_lookup", "with_single_cells"});
  bind<&missing_cells>(module, "missing_cells", {"centre", "cell", "layout"});
  bind<&merge_corners>(module, "merge_corners", {"cells", "numbers", "layout", "corner_ids", "markers"});
}

}  // namespace cmp::numbering
