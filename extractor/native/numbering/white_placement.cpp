#include "numbering/white_placement.hpp"

#include <cmath>
#include <limits>

#include "layout/lattice.hpp"
#include "layout/lattice_tables.hpp"

namespace cmp::numbering {

namespace {

constexpr Index INKS = 3;
constexpr Index MAX_PLACE = std::numeric_limits<std::int32_t>::max();  // beyond every axial coordinate

}  // namespace

PlacedCells::PlacedCells(View<const double, 2> center, View<const std::int32_t, 2> axial,
                         View<const std::int64_t, 1> known, View<const std::int32_t, 2> cell_lookup)
    : center_(center), axial_(axial), known_(known), cell_lookup_(cell_lookup) {
  Index low_q = MAX_PLACE, low_r = MAX_PLACE, high_q = -MAX_PLACE, high_r = -MAX_PLACE;
  for (const std::int64_t i : known) {
    const Index q = axial(i, 0), r = axial(i, 1);
    low_q = std::min(low_q, q);
    low_r = std::min(low_r, r);
    high_q = std::max(high_q, q);
    high_r = std::max(high_r, r);
  }
  first_q_ = low_q - 1;
  first_r_ = low_r - 1;
  walked_ = Array<std::int32_t, 2>({high_q - first_q_ + 2, high_r - first_r_ + 2}, -1);
  for (const std::int64_t i : known)
    walked_(axial(i, 0) - first_q_, axial(i, 1) - first_r_) = static_cast<std::int32_t>(i);
}

// The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red
// is to the right, to the left or above, and a rotation by 0, 120 or 240 degrees brings it to the right.
std::int32_t PlacedCells::cell_at_place(Index q, Index r, View<const std::int32_t, 1> place) const {
  const Index remainder = (place[0] - place[1]) % INKS, turn = remainder < 0 ? remainder + INKS : remainder;
  const auto [placed_q, placed_r] = layout::rotated_cell(q - place[0] + turn, r - place[1], turn);
  return layout::cell_at(cell_lookup_, placed_q, placed_r);
}

Index PlacedCells::fill_placement(View<const std::int32_t, 1> place, View<std::int32_t, 1> cell) const {
  Index inside = 0;
  cell.fill(-1);
  for (const std::int64_t i : known_) {
    cell[i] = cell_at_place(axial_(i, 0), axial_(i, 1), place);
    inside += cell[i] >= 0;
  }
  return inside;
}

Index PlacedCells::count_missing(View<const std::int32_t, 1> place, double width, double height) const {
  Index missing = 0;
  for (const std::int64_t i : known_) {
    const Index q = axial_(i, 0), r = axial_(i, 1), u = q - first_q_, v = r - first_r_;
    if (cell_at_place(q, r, place) < 0) continue;
    for (const auto& [dq, dr] : layout::NEIGHBOUR_STEPS) {
      const std::int32_t opposite = walked_(u - dq, v - dr);
      if (walked_(u + dq, v + dr) >= 0 || opposite < 0) continue;
      if (cell_at_place(q + dq, r + dr, place) < 0) continue;
      const double dx = center_(i, 0) - center_(opposite, 0), dy = center_(i, 1) - center_(opposite, 1);
      const double x = center_(i, 0) + dx, y = center_(i, 1) + dy, margin = std::hypot(dx, dy);
      missing += x > margin && y > margin && x < width - margin && y < height - margin;
    }
  }
  return missing;
}

}  // namespace cmp::numbering
