// Room "layout" for Python.
#include "base/binding.hpp"

#include "layout/covariance_couplings.hpp"
#include "layout/lattice.hpp"
#include "layout/lattice_tables.hpp"
#include "layout/neighbour_tables.hpp"
#include "layout/scatter_bending.hpp"

namespace cmp::layout {

void add_layout(nb::module_ module) {
  module.attr("MIN_LINEAR_NEIGHBOURS") = NeighbourMapLimits{}.min_linear_neighbours;
  module.attr("MIN_QUADRATIC_NEIGHBOURS") = NeighbourMapLimits{}.min_quadratic_neighbours;
  bind<&layer_of>(module, "layer_of", {"q", "r"});
  bind<&marker_id>(module, "marker_id", {"q", "r"});
  bind<&cells_at>(module, "cells_at", {"axial", "cell_lookup"});
  bind<&corner_ids>(module, "corner_ids", {"axial"});
  bind<&neighbour_ids>(module, "neighbour_ids", {"axial", "steps", "layers"});
  bind<&covariance_couplings>(module, "covariance_couplings", {"couplings", "slopes", "gridlines"});
  bind<&scatter_bending>(module, "scatter_bending", {"ids", "weights", "normals", "spokes"});
}

}  // namespace cmp::layout
