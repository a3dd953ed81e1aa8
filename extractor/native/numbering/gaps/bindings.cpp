// Room "gaps" as Python sees it.
#include "base/binding.hpp"
#include "numbering/gaps/detached_cells.hpp"

namespace cmp::numbering {

namespace {

void fill(nb::module_& module) {
  bind<&number_detached>(module, "number_detached",
                         {"cells", "cell", "white_px", "layout", "corner_step", "limits"});
  bind<&is_white_cell_contradicted>(
      module, "is_white_cell_contradicted",
      {"center", "is_intact", "cell", "white_px", "white_mm", "layout", "limits"});
}

const Room room("gaps", fill);

}  // namespace

}  // namespace cmp::numbering
