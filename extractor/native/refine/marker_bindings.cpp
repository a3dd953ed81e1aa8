// Room "markers" for Python: outliers, recovery, acceptance, and the first look at an image.
#include "base/binding.hpp"

#include "refine/acceptance.hpp"
#include "refine/first_look.hpp"
#include "refine/outliers.hpp"
#include "refine/recovered_markers.hpp"

namespace cmp::refine {

void add_markers(nb::module_ module) {
  bind<&correct_outliers>(module, "correct_outliers",
                          {"topology", "markers", "places", "profile_weight", "scale"});
  bind<&accept_markers>(module, "accept_markers", {"solved", "places", "topology"});
  bind<&update_lost_markers>(module, "update_lost_markers",
                             {"xy", "cov", "unaccepted", "predicted", "start", "edge"});
  bind<&fill_recovered_markers>(module, "fill_recovered_markers",
                                {"view", "state", "contrasts", "places", "topology", "markers"});
  bind<&initial_appearance>(module, "initial_appearance", {"view", "topology", "xy", "sigma"});
  bind<&edge_contrasts>(module, "edge_contrasts", {"lines", "xy", "topology", "levels", "view"});
  bind<&blur_and_bleed>(module, "blur_and_bleed", {"view", "lines", "across", "xy", "cells", "assumed"});
}

}  // namespace cmp::refine
