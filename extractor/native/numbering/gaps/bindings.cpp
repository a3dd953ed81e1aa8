// Room "gaps" for Python.
#include "base/binding.hpp"

#include "numbering/gaps/detached_cells.hpp"

namespace cmp::numbering {

void add_gaps(nb::module_ module) {
  bind<&number_detached>(module, "number_detached",
                         {"cells", "cell", "white_px", "layout", "corner_step", "limits"});
  bind<&is_white_cell_contradicted>(
      module, "is_white_cell_contradicted",
      {"center", "is_intact", "cell", "white_px", "white_mm", "layout", "limits"});
}

}  // namespace cmp::numbering
