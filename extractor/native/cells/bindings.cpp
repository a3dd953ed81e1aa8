// Room "cells" for Python.
#include "base/binding.hpp"

#include "cells/cell_mesh.hpp"
#include "cells/cells.hpp"
#include "cells/region_growing.hpp"
#include "cells/seeds.hpp"
#include "cells/triangle_edges.hpp"
#include "cells/triangle_fit.hpp"

namespace cmp::cells {

void add_cells(nb::module_ module) {
  bind<&find_domains>(module, "find_domains", {"label", "max_domains", "limits"});
  bind<&seed_points>(module, "seed_points", {"runs", "domain", "area"});
  bind<&domain_moments>(module, "domain_moments", {"runs", "domain", "seed_xy"});
  bind<&grow>(module, "grow", {"hsv", "label", "seed_xy", "seed_ink", "limit_px", "limits"});
  bind<&fit_to_moments>(module, "fit_to_moments", {"moments", "seed", "limits"});
  bind<&triangle_arrays>(module, "triangle_arrays", {"view", "moments", "seed", "ink", "scale", "limits"});
  bind<&update_triangle_corners>(module, "update_triangle_corners", {"view", "corners", "good", "limits"});
  bind<&cell_arrays>(
      module, "cell_arrays",
      {"seed_center", "ink", "area_px", "region", "corner_px", "scale", "cluttered", "limits"});
  bind<&equilateral_edge>(module, "equilateral_edge", {"area"});
  bind<&is_intact>(module, "is_intact", {"center", "area", "corner", "limits"});
  bind<&build_cell_mesh>(module, "build_cell_mesh", {"cells", "limits"});
  bind<&without_swelling>(module, "without_swelling", {"center", "corner", "swelling"});
}

}  // namespace cmp::cells
