// Room "synthesis" for Python.
#include "base/binding.hpp"

#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/ink_levels.hpp"

namespace cmp::refine {

void add_synthesis(nb::module_ module) {
  bind<&gridlines>(module, "gridlines", {"xy", "maps", "bend", "edges", "along", "scatter_share"});
  bind<&local_maps>(module, "local_maps", {"xy", "near", "offset", "stencil"});
  bind<&level_change>(module, "level_change", {"before", "now"});
}

}  // namespace cmp::refine
