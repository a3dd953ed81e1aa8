// Room "refine" for Python.
#include "base/binding.hpp"

#include "refine/profile_rounds.hpp"
#include "refine/refinement_step.hpp"
#include "refine/refiner.hpp"
#include "refine/synthesis_steps.hpp"

namespace cmp::refine {

void add_refine(nb::module_ module) {
  bind<&extrapolate_pattern>(module, "extrapolate_pattern", {"xy", "topology"});
  bind<&move_pattern>(module, "move_pattern", {"markers", "topology"});
  bind<&profile_step>(module, "profile_step", {"view", "lines", "across", "state", "topology", "stations"});
  bind<&synthesis_step>(module, "synthesis_step",
                        {"view", "topology", "picture", "state", "levels", "stations"});
  bind<&at_full_scale>(module, "at_full_scale", {"xy", "cov", "places", "scale"});
}

}  // namespace cmp::refine
