#include "layout/lattice_tables.hpp"

#include "layout/lattice.hpp"

namespace cmp::layout {

Array<std::int32_t, 1> cells_at(View<const std::int32_t, 2> axial, View<const std::int32_t, 2> cell_lookup) {
  Array<std::int32_t, 1> out({axial.size()});
  const auto cells = out.view();
  for (Index i = 0; i < axial.size(); ++i) cells[i] = cell_at(cell_lookup, axial(i, 0), axial(i, 1));
  return out;
}

Array<std::int32_t, 2> corner_ids(View<const std::int32_t, 2> axial) {
  Array<std::int32_t, 2> out({axial.size(), 3});
  const auto ids = out.view();
  for (Index i = 0; i < axial.size(); ++i) {
    const Index q = axial(i, 0), r = axial(i, 1);
    ids(i, 0) = static_cast<std::int32_t>(marker_id(q, r));
    ids(i, 1) = static_cast<std::int32_t>(marker_id(q + 1, r));
    ids(i, 2) = static_cast<std::int32_t>(marker_id(q, r + 1));
  }
  return out;
}

}  // namespace cmp::layout
