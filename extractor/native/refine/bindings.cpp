// Room "refine" for Python.
#include "base/binding.hpp"

#include "refine/drawn_pattern.hpp"
#include "refine/profile_rounds.hpp"
#include "refine/refinement_step.hpp"
#include "refine/refiner.hpp"
#include "refine/synthesis_steps.hpp"

namespace cmp::refine {

void add_refine(nb::module_ module) {
  bind<&extrapolate_pattern>(module, "extrapolate_pattern", {"xy", "topology", "limits"});
  bind<&profile_step>(module, "profile_step",
                      {"view", "lines", "across", "state", "topology", "stations", "limits"});
  bind<&draw_pattern>(module, "draw_pattern",
                      {"view", "topology", "picture", "state", "levels", "box", "limits"});
  bind<&update_and_solve>(module, "update_and_solve", {"drawing", "state", "topology", "limits"});
  bind<&at_full_scale>(module, "at_full_scale", {"xy", "cov", "places", "scale", "limits"});
}

}  // namespace cmp::refine
