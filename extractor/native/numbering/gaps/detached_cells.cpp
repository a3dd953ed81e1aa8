#include "numbering/gaps/detached_cells.hpp"

#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

namespace {

using localmap::SUPPORT_CELLS;

constexpr Index INKS = 256;  // values of an ink's number

// Removes the numbers of inconsistent cells; returns whether there are any.
//
// The removed cells are erased from the corner_neighbours (N, 6).
bool remove_inconsistent(View<std::int32_t, 1> cell, View<const bool, 1> consistent,
                         View<std::int32_t, 2> neighbours) {
  bool is_any_removed = false;
  for (Index i = 0; i < cell.size(); ++i) {
    if (cell[i] < 0 || consistent[i]) continue;
    cell[i] = -1;
    is_any_removed = true;
    for (Index k = 0; k < neighbours.size(1); ++k) {
      if (neighbours(i, k) < 0) continue;
      neighbours(neighbours(i, k), (k + 3) % 6) = -1;
      neighbours(i, k) = -1;
    }
  }
  return is_any_removed;
}

struct FreePlaces {
  Array<bool, 1> free;        // (U,) the free cells of the layout
  Array<bool, 1> candidates;  // (N,) the cells without a number that have the ink of a free one
};

FreePlaces free_places_and_candidates(View<const std::uint8_t, 1> ink, View<const std::int32_t, 1> cell,
                                      View<const std::uint8_t, 1> layout_ink) {
  FreePlaces out{Array<bool, 1>({layout_ink.size()}, true), Array<bool, 1>({cell.size()})};
  for (const std::int32_t u : cell) {
    if (u >= 0) out.free[u] = false;
  }
  std::array<bool, INKS> is_free_ink{};
  for (Index u = 0; u < layout_ink.size(); ++u) {
    if (out.free[u]) is_free_ink[layout_ink[u]] = true;
  }
  for (Index i = 0; i < cell.size(); ++i) out.candidates[i] = cell[i] < 0 && is_free_ink[ink[i]];
  return out;
}

// Numbers the cells with a unique assignment and a gap up to the limit; returns these cells.
Array<std::int64_t, 1> update_unique_assignments(const CellAssignments& assignments, double limit,
                                                 PartialNumbering& numbering) {
  const auto candidate = assignments.candidate;
  Array<std::int64_t, 1> new_cells({candidate.size()});
  Index count = 0;
  for (Index n = 0; n < candidate.size(); ++n) {
    const std::int32_t place = assignments.place[n];
    if (place < 0 || assignments.candidate_count[place] != 1 || !(assignments.gap[n] <= limit)) continue;
    numbering.cell[candidate[n]] = place;
    numbering.free[place] = false;
    new_cells[count++] = candidate[n];
  }
  return new_cells.first(count);
}

// Orients the triangle of cell i like the nearest of the numbered cells that has an orientation;
// UNKNOWN_CORNER without one.
void update_first_corner_by_nearest(const Contacts& contacts, Index i, const SupportCells& support,
                                    PartialNumbering& numbering) {
  std::array<std::int32_t, SUPPORT_CELLS> index;
  std::array<double, SUPPORT_CELLS> square;
  const auto center = contacts.cells.center_px;
  const Index found =
      numeric::fill_nearest_points(support.grid, center(i, 0), center(i, 1), {index.data(), {SUPPORT_CELLS}},
                                   {square.data(), {SUPPORT_CELLS}});
  const auto maps = numbering.maps.view();
  numbering.first_corner[i] = UNKNOWN_CORNER;
  for (Index k = 0; k < found; ++k) {
    const Index j = support.cells[index[k]];
    if (update_first_corner(contacts, j, numbering) < 0) continue;
    numbering.first_corner[i] = fill_map_by_similarity(contacts, i, numbering.cell[i], maps[j], maps[i]);
    break;
  }
}

// The cells of one array, then those of another.
Array<std::int64_t, 1> joined(View<const std::int64_t, 1> first, View<const std::int64_t, 1> second) {
  Array<std::int64_t, 1> out({first.size() + second.size()});
  std::copy(second.begin(), second.end(), std::copy(first.begin(), first.end(), out.begin()));
  return out;
}

// The intact ones of the cells.
Array<std::int64_t, 1> intact_ones(View<const std::int64_t, 1> cells, View<const bool, 1> is_intact) {
  Array<std::int64_t, 1> out({cells.size()});
  Index count = 0;
  for (const std::int64_t i : cells) {
    if (is_intact[i]) out[count++] = i;
  }
  return out.first(count);
}

// The intact cells with a number.
Array<std::int64_t, 1> numbered_cells(View<const std::int32_t, 1> cell, View<const bool, 1> is_intact) {
  Array<bool, 1> selected({cell.size()});
  for (Index i = 0; i < cell.size(); ++i) selected[i] = cell[i] >= 0 && is_intact[i];
  return numbers_of(selected);
}

// (N,), cell with numbers of candidates added, round by round outward from the numbered cells.
Array<std::int32_t, 1> number_outward(const Contacts& contacts, const FreePlaces& places,
                                      View<const std::int32_t, 1> cell, const DetachedLimits& limits) {
  const auto& cells = contacts.cells;
  PartialNumbering numbering = begin_numbering(cell, places.free);
  const Array<std::int64_t, 1> unnumbered = numbers_of(places.candidates);
  Array<bool, 1> is_triangle({cell.size()});
  for (Index i = 0; i < cell.size(); ++i)
    is_triangle[i] = places.candidates[i] && cells.is_intact[i] && std::isfinite(cells.corner_px(i, 0, 0));
  const Array<std::int64_t, 1> triangles = numbers_of(is_triangle);
  Array<std::int64_t, 1> new_cells = numbered_cells(cell, cells.is_intact);
  CellAssignments assignments = empty_assignments(unnumbered, places.free.size());
  const ClaimedCells scene{cells, contacts.layout, limits.claims};
  for (Index round = 0; round < limits.max_rounds; ++round) {
    const Array<std::int64_t, 1> touched =
        update_numbers_by_contact(contacts, triangles, new_cells, numbering);
    new_cells = joined(new_cells, touched);
    const Array<std::int64_t, 1> known = numbered_cells(numbering.cell, cells.is_intact);
    const auto is_numbered = [&numbering](std::int64_t i) { return numbering.cell[i] >= 0; };
    const auto waiting = unnumbered.view();
    if (known.size() < limits.min_numbered_cells || std::all_of(waiting.begin(), waiting.end(), is_numbered))
      break;
    const Array<double, 2> points = selected_points(cells.center_px, known);
    const numeric::BucketGrid grid = numeric::bucket_grid(points);
    const SupportCells support{known, grid};
    update_outdated_assignments(cells.center_px, new_cells, numbering, assignments);
    const double limit = update_assignments(scene, support, numbering, assignments);
    new_cells = update_unique_assignments(assignments, limit, numbering);
    if (new_cells.size() == 0) break;
    new_cells = intact_ones(new_cells, cells.is_intact);
    for (const std::int64_t i : new_cells) update_first_corner_by_nearest(contacts, i, support, numbering);
  }
  return std::move(numbering.cell);
}

}  // namespace

Array<std::int32_t, 1> number_detached(const cells::CellArrays& cells, View<const std::int32_t, 1> cell,
                                       View<const double, 1> white_px, const layout::LayoutCells& layout,
                                       Index corner_step, const DetachedLimits& limits) {
  const Contacts contacts(cells, layout, corner_step, limits.check.contact);
  Array<std::int32_t, 1> out(cell);
  Array<std::int32_t, 2> neighbours = corner_neighbours(contacts, out);
  const bool is_any_removed = remove_inconsistent(
      out, consistent_cells(contacts, out, white_px, neighbours, limits.check), neighbours);
  const FreePlaces places = free_places_and_candidates(cells.ink, out, layout.ink);
  const auto candidates = places.candidates.view();
  if (std::find(candidates.begin(), candidates.end(), true) == candidates.end()) return out;
  Array<std::int32_t, 1> extended = number_outward(contacts, places, out, limits);
  Array<bool, 1> is_new({cell.size()});
  for (Index i = 0; i < cell.size(); ++i) is_new[i] = extended[i] != out[i];
  if (!is_any_removed && std::find(is_new.begin(), is_new.end(), true) == is_new.end()) return out;
  update_corner_neighbours(is_new, contacts, extended, neighbours);
  remove_inconsistent(extended, consistent_cells(contacts, extended, white_px, neighbours, limits.check),
                      neighbours);
  return extended;
}

}  // namespace cmp::numbering
