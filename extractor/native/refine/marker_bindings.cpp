// Room "markers" for Python: outliers, recovery, acceptance, and the first look at an image.
#include "base/binding.hpp"

#include "refine/acceptance.hpp"
#include "refine/first_look.hpp"
#include "refine/outliers.hpp"
#include "refine/recovered_markers.hpp"

namespace cmp::refine {

void add_markers(nb::module_ module) {
  bind<&suspect_markers<double>>(module, "suspect_markers", {"profile_weight", "weight", "spokes", "limits"});
  bind<&correct_outliers>(module, "correct_outliers",
                          {"topology", "markers", "places", "suspect", "scale", "limits"});
  bind<&accepted_markers>(
      module, "accepted_markers",
      {"measured", "information", "bend_variance", "edges", "spokes", "places", "selected", "limits"});
  bind<&add_dirt_variance>(module, "add_dirt_variance", {"cov", "weight", "spokes", "edge", "limits"});
  bind<&update_unaccepted_markers>(
      module, "update_unaccepted_markers",
      {"xy", "cov", "reliable", "start", "edge", "unexplained", "dot_gain", "limits"});
  bind<&update_lost_markers>(module, "update_lost_markers",
                             {"xy", "cov", "unaccepted", "predicted", "start", "edge", "limits"});
  bind<&fill_recovered_markers>(module, "fill_recovered_markers",
                                {"view", "state", "contrasts", "places", "topology", "markers", "limits"});
  bind<&initial_appearance>(module, "initial_appearance", {"view", "topology", "xy", "sigma", "limits"});
  bind<&edge_contrasts>(module, "edge_contrasts", {"lines", "xy", "topology", "levels", "view", "limits"});
  bind<&blur_and_bleed>(module, "blur_and_bleed",
                        {"view", "lines", "across", "xy", "cells", "assumed", "limits"});
}

}  // namespace cmp::refine
