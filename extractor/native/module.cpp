// The module `extractor._native`: a submodule for each room that has loops.
#include "base/binding.hpp"

namespace cmp::cells {
void add_cells(nb::module_ module);
}  // namespace cmp::cells

namespace cmp::complete {
void add_complete(nb::module_ module);
}  // namespace cmp::complete

namespace cmp::contact {
void add_contact(nb::module_ module);
}  // namespace cmp::contact

namespace cmp::image {
void add_image(nb::module_ module);
}  // namespace cmp::image

namespace cmp::layout {
void add_layout(nb::module_ module);
}  // namespace cmp::layout

namespace cmp::localmap {
void add_localmap(nb::module_ module);
}  // namespace cmp::localmap

namespace cmp::numbering {
void add_numbering(nb::module_ module);
}  // namespace cmp::numbering

namespace cmp::numeric {
void add_numeric(nb::module_ module);
}  // namespace cmp::numeric

namespace cmp::refine {
void add_refine(nb::module_ module);
void add_measure(nb::module_ module);
void add_synthesis(nb::module_ module);
void add_solve(nb::module_ module);
}  // namespace cmp::refine

namespace cmp::space {
void add_space(nb::module_ module);
}  // namespace cmp::space

namespace cmp::track {
void add_track(nb::module_ module);
}  // namespace cmp::track

NB_MODULE(_native, module) {
  cmp::require_processor();
  cmp::numeric::add_numeric(module.def_submodule("numeric"));
  cmp::layout::add_layout(module.def_submodule("layout"));
  cmp::localmap::add_localmap(module.def_submodule("localmap"));
  cmp::image::add_image(module.def_submodule("image"));
  cmp::cells::add_cells(module.def_submodule("cells"));
  cmp::numbering::add_numbering(module.def_submodule("numbering"));
  cmp::refine::add_refine(module.def_submodule("refine"));
  cmp::refine::add_measure(module.def_submodule("measure"));
  cmp::refine::add_synthesis(module.def_submodule("synthesis"));
  cmp::refine::add_solve(module.def_submodule("solve"));
  cmp::complete::add_complete(module.def_submodule("complete"));
  cmp::contact::add_contact(module.def_submodule("contact"));
  cmp::space::add_space(module.def_submodule("space"));
  cmp::track::add_track(module.def_submodule("track"));
}
