// Room "track" for Python.
#include "base/binding.hpp"

#include "track/seen_cells.hpp"
#include "track/warm_start.hpp"

namespace cmp::track {

void add_track(nb::module_ module) {
  bind<&seen_cells>(module, "seen_cells", {"view", "xy_px", "tables"});
  bind<&warm_start>(module, "warm_start", {"view", "state", "tables"});
}

}  // namespace cmp::track
