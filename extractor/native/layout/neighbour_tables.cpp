#include "layout/neighbour_tables.hpp"

#include "layout/lattice.hpp"

namespace cmp::layout {

Array<std::int32_t, 2> neighbour_ids(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> steps,
                                     Index layers) {
  const Index count = steps.size();
  Array<std::int32_t, 2> out({axial.size(), count});
  const auto ids = out.view();
  for (Index m = 0; m < axial.size(); ++m)
    for (Index k = 0; k < count; ++k) {
      const Index q = axial(m, 0) + steps(k, 0), r = axial(m, 1) + steps(k, 1);
      ids(m, k) = layer_of(q, r) <= layers ? static_cast<std::int32_t>(marker_id(q, r)) : -1;
    }
  return out;
}

}  // namespace cmp::layout
