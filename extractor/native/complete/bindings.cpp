// Room "complete" for Python.
#include "base/binding.hpp"

#include "complete/image_quality.hpp"
#include "complete/layer_arcs.hpp"
#include "complete/repair.hpp"
#include "complete/row_breaks.hpp"
#include "complete/virtual_markers.hpp"

namespace cmp::complete {

namespace {

std::tuple<Array<double, 2>, Array<double, 1>, Array<double, 1>> places_by_layer(
    View<const double, 2> xy, View<const double, 1> noise_px2, Index layers, const LayerLimits& limits) {
  LayerPrediction found = predict_by_layer(xy, noise_px2, layers, limits);
  return {std::move(found.xy_px), std::move(found.misfit_px2), std::move(found.variance_px2)};
}

}  // namespace

void add_complete(nb::module_ module) {
  bind<&places_by_layer>(module, "predict_by_layer", {"xy", "noise_px2", "layers", "limits"});
  bind<&repair_markers>(module, "repair_markers", {"refined", "places", "tables", "size", "limits"});
  bind<&locate_on_edges>(module, "locate_on_edges", {"markers", "scatter", "topology", "points"});
  bind<&measure_jumps>(module, "measure_jumps", {"markers", "topology", "limits"});
  bind<&measure_numbered>(module, "measure_numbered", {"view", "cells", "xy", "edges"});
  module.attr("CLIPPED_VALUE") = QualityLimits{}.clipped_value;
}

}  // namespace cmp::complete
