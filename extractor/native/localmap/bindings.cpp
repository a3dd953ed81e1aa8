// Room "localmap" for Python.
#include "base/binding.hpp"

#include "localmap/neighbour_prediction.hpp"

namespace cmp::localmap {

void add_localmap(nb::module_ module) {
  bind<&predict_markers>(module, "predict_markers", {"xy_px", "noise_px2", "wanted", "marker_mm", "table"});
}

}  // namespace cmp::localmap
