// The module `cmpdesign._native`: a submodule for each subject with loops.
#include "base/binding.hpp"

namespace cmp {
void add_coverage(nb::module_ module);
void add_occlusion(nb::module_ module);
void add_encoding(nb::module_ module);
void add_depth_buffer(nb::module_ module);
void add_elastic_layer(nb::module_ module);
void add_tour(nb::module_ module);
void add_pad_code(nb::module_ module);
}  // namespace cmp

NB_MODULE(_native, module) {
  cmp::require_processor();
  cmp::add_coverage(module.def_submodule("coverage"));
  cmp::add_occlusion(module.def_submodule("occlusion"));
  cmp::add_encoding(module.def_submodule("encoding"));
  cmp::add_depth_buffer(module.def_submodule("depth_buffer"));
  cmp::add_elastic_layer(module.def_submodule("elastic_layer"));
  cmp::add_tour(module.def_submodule("tour"));
  cmp::add_pad_code(module.def_submodule("pad_code"));
}
