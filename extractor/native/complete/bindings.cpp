// Room "complete" for Python.
#include "base/binding.hpp"

#include "complete/image_quality.hpp"
#include "complete/layer_arcs.hpp"
#include "complete/repair.hpp"
#include "complete/row_breaks.hpp"
#include "complete/virtual_markers.hpp"

namespace cmp::complete {

void add_complete(nb::module_ module) {
  bind<&predict_by_layer>(module, "predict_by_layer", {"xy", "noise_px2", "layers"});
  bind<&repair_markers>(module, "repair_markers", {"refined", "places", "tables", "size"});
  bind<&locate_on_edges>(module, "locate_on_edges", {"markers", "scatter", "topology", "points"});
  bind<&measure_jumps>(module, "measure_jumps", {"xy", "topology"});
  bind<&measure_numbered>(module, "measure_numbered", {"view", "cells", "xy", "edges"});
  module.attr("STRIP_EDGES") = JumpLimits{}.bin;
  module.attr("MIN_STRIP_GRIDLINES") = JumpLimits{}.min_gridlines;
  module.attr("CLIPPED_VALUE") = QualityLimits{}.clipped_value;
}

}  // namespace cmp::complete
