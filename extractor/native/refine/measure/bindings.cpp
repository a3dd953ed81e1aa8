// Room "measure" for Python.
#include "base/binding.hpp"

#include "refine/measure/gridline_offsets.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/measure/marker_scatter.hpp"

namespace cmp::refine {

void add_measure(nb::module_ module) {
  bind<&measure_scatter>(module, "measure_scatter", {"xy", "maps", "diagonal", "topology"});
  bind<&virtual_markers>(module, "virtual_markers", {"reading", "scale"});
  bind<&short_edge>(module, "short_edge", {"xy", "edges", "rarity"});
  module.attr("MIN_NOISE") = GridlineWeightLimits{}.min_noise;
  module.attr("MIN_SIGMA_PX") = GridlineWeightLimits{}.min_sigma_px;
}

}  // namespace cmp::refine
