#include "numbering/gaps/cell_claims.hpp"

#include <limits>

namespace cmp::numbering {

namespace {

using localmap::SUPPORT_CELLS;

constexpr double INFINITE = std::numeric_limits<double>::infinity();

double squared(double value) { return value * value; }

// Whether one of the other cells lies nearer to cell i than the root of radius2, px^2.
bool is_any_within(View<const double, 2> center, Index i, View<const std::int64_t, 1> others,
                   double radius2) {
  for (const Index j : others) {
    const double x = center(j, 0) - center(i, 0), y = center(j, 1) - center(i, 1);
    if (x * x + y * y < radius2) return true;
  }
  return false;
}

// Writes the gaps; cells too far from the numbered ones for any map need no evaluation.
void update_gaps(const ClaimedCells& scene, const SupportCells& support, View<const std::int32_t, 1> cell,
                 CellAssignments& assignments) {
  const auto center = scene.cells.center_px;
  const double max_gap = scene.limits.max_gap_ratio * scene.limits.maps.max_support_distance;
  for (Index n = 0; n < assignments.candidate.size(); ++n) {
    const Index i = assignments.candidate[n];
    if (cell[i] >= 0) {
      assignments.gap[n] = INFINITE;
      assignments.is_evaluated[n] = true;
      continue;
    }
    std::int32_t nearest = 0;
    double square = 0.0;
    numeric::fill_nearest_points(support.grid, center(i, 0), center(i, 1), {&nearest, {1}}, {&square, {1}});
    assignments.gap[n] = std::sqrt(square) / equilateral_edge(scene.cells.area_px[support.cells[nearest]]);
    if (!assignments.is_evaluated[n] && !(assignments.gap[n] < max_gap)) {
      // to be evaluated again after any new number
      assignments.support_radius2[n] = INFINITE;
      assignments.is_evaluated[n] = true;
    }
  }
}

// The free cell of the layout with this ink that is nearest to the predicted place, or -1 beyond the limit.
std::int32_t nearest_place_of_ink(View<const std::int64_t, 1> free, const localmap::LayoutPlace& predicted,
                                  std::uint8_t ink, const ClaimedCells& scene) {
  const auto center_mm = scene.layout.center_mm;
  std::int32_t best = -1;
  if (std::isnan(predicted.x_mm)) return best;
  double least = squared(scene.limits.max_place_misfit * predicted.cell_size_mm);
  for (const Index u : free) {
    if (scene.layout.ink[u] != ink) continue;
    const double dx = center_mm(u, 0) - predicted.x_mm, dy = center_mm(u, 1) - predicted.y_mm;
    const double square = dx * dx + dy * dy;
    if (square < least) {
      best = static_cast<std::int32_t>(u);
      least = square;
    }
  }
  return best;
}

// What all assignments of one update have in common.
struct Round {
  const ClaimedCells& scene;
  const SupportCells& support;
  View<const std::int32_t, 1> cell;  // (N,) the layout's cell of each cell of the image, or -1
  View<const std::int64_t, 1> free;  // (F,) the free cells of the layout
};

// Assigns candidate n to one of the free cells of the layout, or to none.
void update_cell_assignment(const Round& round, Index n, CellAssignments& assignments,
                            localmap::MapBuffers& buffers) {
  const auto center = round.scene.cells.center_px;
  const Index i = assignments.candidate[n];
  std::array<std::int32_t, SUPPORT_CELLS> index;
  std::array<double, SUPPORT_CELLS> square;
  const View<std::int32_t, 1> nearest(index.data(), {SUPPORT_CELLS});
  const View<double, 1> squares(square.data(), {SUPPORT_CELLS});
  const Index count =
      numeric::fill_nearest_points(round.support.grid, center(i, 0), center(i, 1), nearest, squares);
  const localmap::NumberedCells known{center, round.support.cells, round.cell};
  const auto predicted = localmap::fill_quadratic_map(known, i, nearest.slice(0, count), squares,
                                                      round.scene.layout, round.scene.limits.maps, buffers);
  const std::int32_t place =
      nearest_place_of_ink(round.free, predicted, round.scene.cells.ink[i], round.scene);
  assignments.support_radius2[n] = count == SUPPORT_CELLS ? squares[count - 1] : INFINITE;
  assignments.place[n] = place;
  assignments.is_evaluated[n] = true;
  if (place >= 0) ++assignments.candidate_count[place];
}

// Whether two cells of one ink are so close that both may be assigned to one cell of the layout.
bool is_possible_rival(const ClaimedCells& scene, Index i, Index j) {
  const auto& cells = scene.cells;
  if (cells.ink[i] != cells.ink[j]) return false;
  const double x = cells.center_px(j, 0) - cells.center_px(i, 0);
  const double y = cells.center_px(j, 1) - cells.center_px(i, 1);
  const double edge = equilateral_edge(std::max(cells.area_px[i], cells.area_px[j]));
  return x * x + y * y < squared(scene.limits.rival_distance * edge);
}

// Assigns the possible rivals of the cells with an assignment and a gap up to the horizon.
void update_rivals(const Round& round, double horizon, CellAssignments& assignments,
                   localmap::MapBuffers& buffers) {
  const auto candidate = assignments.candidate;
  for (Index n = 0; n < candidate.size(); ++n) {
    if (assignments.place[n] < 0 || assignments.gap[n] > horizon) continue;
    for (Index m = 0; m < candidate.size(); ++m) {
      if (!assignments.is_evaluated[m] && is_possible_rival(round.scene, candidate[n], candidate[m]))
        update_cell_assignment(round, m, assignments, buffers);
    }
  }
}

struct GapLimit {
  double limit;     // the gap up to which cells are numbered together, infinite without a unique assignment
  double next_gap;  // the least gap of the cells not evaluated
};

GapLimit joint_gap_limit(const CellAssignments& assignments, const CellClaimLimits& limits) {
  double least = INFINITE, next_gap = INFINITE;
  for (Index n = 0; n < assignments.place.size(); ++n) {
    const std::int32_t place = assignments.place[n];
    if (!assignments.is_evaluated[n])
      next_gap = std::min(next_gap, assignments.gap[n]);
    else if (place >= 0 && assignments.candidate_count[place] == 1)
      least = std::min(least, assignments.gap[n]);
  }
  return {std::max(limits.joint_gap, limits.joint_gap_ratio * least), next_gap};
}

}  // namespace

CellAssignments empty_assignments(View<const std::int64_t, 1> candidate, Index places) {
  const Index count = candidate.size();
  return {candidate,
          Array<std::int32_t, 1>({count}, -1),
          Array<bool, 1>({count}, false),
          Array<double, 1>({count}),
          Array<double, 1>({count}),
          Array<std::int32_t, 1>({places}, 0)};
}

void update_outdated_assignments(View<const double, 2> center, View<const std::int64_t, 1> new_cells,
                                 const PartialNumbering& numbering, CellAssignments& assignments) {
  assignments.candidate_count.fill(0);
  for (Index n = 0; n < assignments.candidate.size(); ++n) {
    const Index i = assignments.candidate[n];
    std::int32_t& place = assignments.place[n];
    const bool is_numbered = numbering.cell[i] >= 0;
    if (is_numbered || (place >= 0 && !numbering.free[place])) place = -1;
    if (!is_numbered && assignments.is_evaluated[n] &&
        is_any_within(center, i, new_cells, assignments.support_radius2[n])) {
      place = -1;
      assignments.is_evaluated[n] = false;
    }
    if (place >= 0) ++assignments.candidate_count[place];
  }
}

double update_assignments(const ClaimedCells& scene, const SupportCells& support,
                          const PartialNumbering& numbering, CellAssignments& assignments) {
  update_gaps(scene, support, numbering.cell, assignments);
  const Array<std::int64_t, 1> free = numbers_of(numbering.free);
  const Round round{scene, support, numbering.cell, free};
  localmap::MapBuffers buffers;
  double horizon = scene.limits.joint_gap;
  while (true) {
    for (Index n = 0; n < assignments.candidate.size(); ++n) {
      if (!assignments.is_evaluated[n] && assignments.gap[n] <= horizon)
        update_cell_assignment(round, n, assignments, buffers);
    }
    update_rivals(round, horizon, assignments, buffers);
    const auto [limit, next_gap] = joint_gap_limit(assignments, scene.limits);
    if (limit <= horizon || next_gap == INFINITE) return limit;
    horizon = std::min(limit, scene.limits.joint_gap_ratio * next_gap);
  }
}

}  // namespace cmp::numbering
