// The module `cmpdesign._native`: a submodule for each subject that has loops.
#include "base/binding.hpp"

NB_MODULE(_native, module) {
  cmp::require_processor();
  cmp::Room::add_all(module);
}
