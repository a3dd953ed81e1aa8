// Room "cells" for Python.
#include "base/binding.hpp"

#include "cells/cell_candidates.hpp"
#include "cells/cell_mesh.hpp"
#include "cells/region_growing.hpp"
#include "cells/triangle_edges.hpp"
#include "cells/triangle_fit.hpp"

namespace cmp::cells {

void add_cells(nb::module_ module) {
  bind<&find_candidates>(module, "find_candidates", {"image", "maps", "shares", "known", "tile_px"});
  bind<&grow>(module, "grow", {"hsv", "seed_xy", "limit_px"});
  bind<&fit_to_moments>(module, "fit_to_moments", {"moments", "seed"});
  bind<&update_triangle_corners>(module, "update_triangle_corners", {"view", "corners", "good"});
  bind<&link_cells>(module, "link_cells", {"centre", "corner"});
}

}  // namespace cmp::cells
