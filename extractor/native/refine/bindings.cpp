// Room "refine" for Python.
#include "base/binding.hpp"

#include "refine/first_estimate.hpp"
#include "refine/refinement_step.hpp"
#include "refine/refiner.hpp"

namespace cmp::refine {

void add_refine(nb::module_ module) {
  bind<&first_estimate>(module, "first_estimate", {"view", "topology", "start", "places", "known", "rows"});
  bind<&refined_markers>(module, "refined_markers", {"view", "topology", "first", "schedule", "stations"});
  bind<&refined_again>(module, "refined_again",
                       {"view", "topology", "places", "known", "schedule", "stations"});
  module.attr("FOOT_DEVIATION") = ParallaxLimits{}.foot_deviation;
  bind<&extrapolate_pattern>(module, "extrapolate_pattern", {"xy", "topology"});
}

}  // namespace cmp::refine
