// Room "complete" for Python.
#include "base/binding.hpp"

#include "complete/finished_markers.hpp"
#include "complete/layer_arcs.hpp"
#include "complete/virtual_markers.hpp"

namespace cmp::complete {

void add_complete(nb::module_ module) {
  bind<&predict_by_layer>(module, "predict_by_layer", {"xy", "noise_px2", "layers"});
  bind<&finish_markers>(module, "finish_markers",
                        {"view", "refined", "places", "tables", "topology", "cells"});
  bind<&locate_on_edges>(module, "locate_on_edges", {"markers", "scatter", "topology", "points"});
  module.attr("STRIP_EDGES") = JumpLimits{}.bin;
  module.attr("MIN_STRIP_GRIDLINES") = JumpLimits{}.min_gridlines;
  module.attr("CLIPPED_VALUE") = QualityLimits{}.clipped_value;
}

}  // namespace cmp::complete
