// Room "measure" for Python.
#include "base/binding.hpp"

#include "refine/measure/dot_gain.hpp"
#include "refine/measure/gridline_offsets.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/ink_shift.hpp"
#include "refine/measure/marker_scatter.hpp"

namespace cmp::refine {

void add_measure(nb::module_ module) {
  bind<&measure_scatter>(module, "measure_scatter", {"xy", "maps", "diagonal", "topology"});
  bind<&measure_offsets>(module, "measure_offsets", {"view", "reading"});
  bind<&virtual_markers>(module, "virtual_markers", {"lines", "offsets", "scale"});
  bind<&short_edge>(module, "short_edge", {"xy", "edges", "rarity"});
  bind<&markers_without_dot_gain>(module, "markers_without_dot_gain", {"xy", "cells", "dot_gain"});
  bind<&ink_offsets>(module, "ink_offsets", {"shift", "lines", "maps", "topology"});
  bind<&crossing_shifts>(module, "crossing_shifts", {"shift", "lines", "maps", "topology"});
  module.attr("MIN_NOISE") = GridlineWeightLimits{}.min_noise;
  module.attr("MIN_SIGMA_PX") = GridlineWeightLimits{}.min_sigma_px;
}

}  // namespace cmp::refine
