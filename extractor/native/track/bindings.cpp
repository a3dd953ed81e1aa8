// Room "track" for Python.
#include "base/binding.hpp"

#include "track/image_check.hpp"
#include "track/ink_alignment.hpp"
#include "track/warm_start.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

void add_track(nb::module_ module) {
  bind<&predict_missing>(module, "predict_missing", {"completion", "weights", "xy"});
  bind<&check_cells>(module, "check_cells", {"image", "xy", "tables", "before", "compare"});
  bind<&measure_shifts>(module, "measure_shifts", {"image", "xy", "tables", "levels"});
  bind<&update_shifts_and_move_markers>(module, "update_shifts_and_move_markers", {"xy", "shift", "corners"});
  bind<&count_matching_centres>(module, "count_matching_centres", {"image", "xy", "tables", "levels"});
  bind<&connected_cells>(module, "connected_cells",
                         {"verdict", "first", "known", "corners", "cells_of_marker"});
  bind<&verified_markers>(module, "verified_markers", {"xy", "proved", "corners"});
}

}  // namespace cmp::track
