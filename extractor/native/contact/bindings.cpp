// Room "contact" for Python.
#include "base/binding.hpp"

#include "contact/settle.hpp"

namespace cmp::contact {

void add_contact(nb::module_ module) {
  bind<&settle>(module, "settle", {"by_load", "whitening", "white", "information"});
}

}  // namespace cmp::contact
