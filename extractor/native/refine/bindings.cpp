// Room "refine" for Python.
#include "base/binding.hpp"

#include "refine/first_estimate.hpp"
#include "refine/refinement_step.hpp"
#include "refine/refiner.hpp"

namespace cmp::refine {

void add_refine(nb::module_ module) {
  bind<&first_estimate>(module, "first_estimate", {"view", "topology", "start", "places", "known", "rows"});
  bind<&measure_image>(module, "measure_image", {"view", "topology", "first", "small_remainder", "stations"});
  bind<&extrapolate_pattern>(module, "extrapolate_pattern", {"xy", "topology"});
}

}  // namespace cmp::refine
