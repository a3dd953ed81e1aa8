#include "numbering/outline_fit.hpp"

#include <cstdlib>

#include "layout/lattice.hpp"
#include "layout/lattice_tables.hpp"

namespace cmp::numbering {

namespace {

using layout::cell_at;
using layout::UNKNOWN_AXIAL;

constexpr Index NO_FIT = Index{1} << 30;

// The least and the largest of the coordinates q, r and q + r.
struct Extents {
  std::array<Index, 3> least{NO_FIT, NO_FIT, NO_FIT}, largest{-NO_FIT, -NO_FIT, -NO_FIT};
};

// The least and the next least number of cells outside; the rotation and the shift of the best alignment.
struct Alignment {
  Index best = NO_FIT, next_best = NO_FIT;
  int turn = 0;
  std::int32_t shift_q = 0, shift_r = 0;
};

Extents axial_extents(View<const std::int32_t, 2> axial) {
  Extents out;
  for (Index i = 0; i < axial.size(); ++i) {
    const Index q = axial(i, 0), r = axial(i, 1);
    const std::array<Index, 3> values{q, r, q + r};
    for (int k = 0; k < 3; ++k) {
      out.least[k] = std::min(out.least[k], values[k]);
      out.largest[k] = std::max(out.largest[k], values[k]);
    }
  }
  return out;
}

// (K,) the indices of the cells that have axial coordinates.
Array<Index, 1> known_cells(View<const std::int32_t, 2> axial) {
  Array<Index, 1> known({axial.size()});
  Index count = 0;
  for (Index i = 0; i < axial.size(); ++i)
    if (axial(i, 0) != UNKNOWN_AXIAL) known[count++] = i;
  return known.first(count);
}

// (K, 2) the axial places of the known cells (K,), the rim first: its cells are the first outside.
Array<std::int32_t, 2> outermost_first(View<const std::int32_t, 2> axial, View<const Index, 1> known,
                                       Index rim_width) {
  const Index count = known.size();
  Array<std::int32_t, 2> place({count, 2}), out({count, 2});
  for (Index k = 0; k < count; ++k) {
    place(k, 0) = axial(known[k], 0);
    place(k, 1) = axial(known[k], 1);
  }
  const Extents extents = axial_extents(place);
  std::array<Index, 3> middle;
  for (int k = 0; k < 3; ++k) middle[k] = extents.least[k] + extents.largest[k];
  Array<Index, 1> radius({count});  // from the middle, in half steps
  for (Index k = 0; k < count; ++k) {
    const Index q = place(k, 0), r = place(k, 1);
    radius[k] = std::max(
        {std::abs(2 * q - middle[0]), std::abs(2 * r - middle[1]), std::abs(2 * (q + r) - middle[2])});
  }
  const Index rim = *std::max_element(radius.begin(), radius.end()) - 2 * rim_width;
  Index filled = 0;
  for (const bool is_outer : {true, false})
    for (Index k = 0; k < count; ++k) {
      if ((radius[k] >= rim) != is_outer) continue;
      out(filled, 0) = place(k, 0);
      out(filled, 1) = place(k, 1);
      ++filled;
    }
  return out;
}

// (S, 2) the shifts that carry inks onto themselves and the places' extents nearly into the layout's.
Array<std::int32_t, 2> admissible_shifts(View<const std::int32_t, 2> place, const Extents& layout,
                                         Index margin) {
  const Extents own = axial_extents(place);
  std::array<Index, 3> first, last;
  for (int k = 0; k < 3; ++k) {
    const auto [low, high] =
        std::minmax({layout.least[k] - own.least[k], layout.largest[k] - own.largest[k]});
    first[k] = low - margin;
    last[k] = high + margin;
  }
  Array<std::int32_t, 2> shifts({(last[0] - first[0] + 1) * (last[1] - first[1] + 1), 2});
  Index count = 0;
  for (Index q = first[0]; q <= last[0]; ++q)
    for (Index r = first[1]; r <= last[1]; ++r)
      if ((q - r) % 3 == 0 && first[2] <= q + r && q + r <= last[2]) {
        shifts(count, 0) = static_cast<std::int32_t>(q);
        shifts(count, 1) = static_cast<std::int32_t>(r);
        ++count;
      }
  return shifts.first(count);
}

// The number of places (K, 2), shifted by (q, r), without a cell of the layout; counting stops at `limit`.
Index count_outside(View<const std::int32_t, 2> place, std::int32_t q, std::int32_t r,
                    View<const std::int32_t, 2> cell_lookup, Index limit, Index batch_size) {
  Index count = 0;
  for (Index first = 0; first < place.size() && count < limit; first += batch_size) {
    const Index last = std::min(first + batch_size, place.size());
    for (Index i = first; i < last; ++i) count += cell_at(cell_lookup, place(i, 0) + q, place(i, 1) + r) < 0;
  }
  return count;
}

// With too many possible alignments both numbers are NO_FIT; with a single one they are equal: neither is
// unique.
Alignment best_alignment(View<const std::int32_t, 2> place, View<const std::int32_t, 2> layout_axial,
                         View<const std::int32_t, 2> cell_lookup, const OutlineLimits& limits) {
  const Extents layout = axial_extents(layout_axial);
  Alignment out;
  Index count = 0;
  for (int turn = 0; turn < 3; ++turn) {
    const auto rotated = layout::rotated_cells(place, turn);
    const auto shifts = admissible_shifts(rotated, layout, limits.shift_margin);
    count += shifts.size();
    if (count > limits.max_alignments) return {};
    for (Index n = 0; n < shifts.size(); ++n) {
      const std::int32_t q = shifts(n, 0), r = shifts(n, 1);
      const Index outside = count_outside(rotated, q, r, cell_lookup, out.next_best, limits.batch_size);
      if (outside < out.best)
        out = {outside, out.best, turn, q, r};
      else if (outside < out.next_best)
        out.next_best = outside;
    }
  }
  if (count <= 1) out.next_best = out.best;
  return out;
}

}  // namespace

std::tuple<bool, Array<std::int32_t, 1>> align(View<const std::int32_t, 2> axial,
                                               View<const std::int32_t, 2> layout_axial,
                                               View<const std::int32_t, 2> cell_lookup,
                                               const OutlineLimits& limits) {
  const auto known = known_cells(axial);
  Array<std::int32_t, 1> cell({axial.size()}, -1);
  const Index layout_count = layout_axial.size();
  const double seen = static_cast<double>(known.size()), max_outside = limits.max_outside_share * seen;
  if (seen < limits.min_seen_share * static_cast<double>(layout_count) ||
      static_cast<double>(known.size() - layout_count) > max_outside)
    return {false, std::move(cell)};
  const auto found =
      best_alignment(outermost_first(axial, known, limits.rim_width), layout_axial, cell_lookup, limits);
  const double margin =
      std::max(static_cast<double>(limits.min_margin_cells), limits.min_margin_share * seen);
  if (!(static_cast<double>(found.best) <= max_outside) ||
      static_cast<double>(found.next_best - found.best) < margin)
    return {false, std::move(cell)};
  const View<const Index, 1> indices = known;
  for (const Index i : indices) {
    const auto [q, r] = layout::rotated_cell(axial(i, 0), axial(i, 1), found.turn);
    cell[i] = cell_at(cell_lookup, q + found.shift_q, r + found.shift_r);
  }
  return {true, std::move(cell)};
}

}  // namespace cmp::numbering
