// Room "complete" for Python.
#include "base/binding.hpp"

#include "complete/consistency_filter.hpp"
#include "complete/image_quality.hpp"
#include "complete/layer_arcs.hpp"
#include "complete/repair.hpp"
#include "complete/uncertain_markers.hpp"
#include "complete/virtual_markers.hpp"

namespace cmp::complete {

void add_complete(nb::module_ module) {
  bind<&update_rejecting_inconsistent>(module, "update_rejecting_inconsistent",
                                       {"xy", "cov", "evidence", "tables", "size", "limits"});
  bind<&find_uncertain_markers>(module, "find_uncertain_markers", {"cov", "edge_px", "limits"});
  bind<&predict_by_layer>(module, "predict_by_layer", {"xy", "layers", "limits"});
  bind<&fill_lost_markers>(module, "fill_lost_markers", {"markers", "tables", "size", "limits"});
  bind<&locate_on_edges>(module, "locate_on_edges", {"ends", "topology", "points", "limits"});
  bind<&centers>(module, "centers", {"xy", "corners"});
  bind<&measure>(module, "measure", {"view", "center", "color", "radius", "limits"});
}

}  // namespace cmp::complete
