#include "numbering/lattice_walk.hpp"

#include <queue>
#include <set>
#include <vector>

#include "cells/cell_mesh.hpp"
#include "layout/lattice_tables.hpp"
#include "numbering/lattice_motion.hpp"
#include "numbering/link_bridges.hpp"

namespace cmp::numbering {

namespace {

using cells::STEP_CORNERS;
using cells::STEPS;
using layout::UNKNOWN_AXIAL;

constexpr int CORNER_AXIAL[3][2] = {{0, 0}, {1, 0}, {0, 1}};  // of an up-cell, as in the conventions

// The axial step of link j of a cell whose corner `first` is corner 0.
AxialStep axial_step(Index j, int first) {
  const auto [a, b] = STEP_CORNERS[j];
  const int *from = CORNER_AXIAL[(a + 3 - first) % 3], *to = CORNER_AXIAL[(b + 3 - first) % 3];
  return {from[0] - to[0], from[1] - to[1]};
}

// A cell that can be reached; the best link is followed first.
struct Reached {
  double misfit;
  std::int32_t cell;
  AxialStep place;
  int first;

  friend bool operator>(const Reached& a, const Reached& b) {
    return a.misfit != b.misfit ? a.misfit > b.misfit : a.cell > b.cell;
  }
};

class Walk {
 public:
  Walk(const CellLinks& links, View<const bool, 1> blocked)
      : links_(links),
        blocked_(blocked),
        axial_({blocked.size(), 2}, UNKNOWN_AXIAL),
        first_({blocked.size()}, std::int8_t{0}),
        part_({blocked.size()}, -1) {}

  // Walks over all cells, in parts that begin at the cells with the most links.
  void walk_all() {
    const Index count = blocked_.size();
    std::vector<std::vector<std::int32_t>> by_links(STEPS + 1);
    for (Index i = 0; i < count; ++i) {
      Index links = 0;
      for (Index j = 0; j < STEPS; ++j) links += links_.neighbours(i, j) >= 0;
      by_links[static_cast<std::size_t>(links)].push_back(static_cast<std::int32_t>(i));
    }
    for (Index links = STEPS; links > 0; --links)
      for (const std::int32_t start : by_links[static_cast<std::size_t>(links)])
        if (part_[start] < 0 && !blocked_[start]) walk_from(start);
  }
  // Marks the cells at the links that contradict the walk; returns how many links these are.
  std::int64_t update_contradicted(View<bool, 1> bad) const {
    std::int64_t count = 0;
    for (Index i = 0; i < part_.size(); ++i) {
      if (part_[i] < 0) continue;
      for (Index j = 0; j < STEPS; ++j) {
        const std::int32_t to = links_.neighbours(i, j);
        if (to < i || part_[to] != part_[i]) continue;
        const AxialStep step = axial_step(j, first_[i]);
        if (axial_(to, 0) == axial_(i, 0) + step.q && axial_(to, 1) == axial_(i, 1) + step.r) continue;
        bad[i] = bad[to] = true;
        ++count;
      }
    }
    return count;
  }
  // Parts are what hangs together by loops of links: a single link may be false, and joins nothing.
  void part_at_bridges() { part_ = parts_without_bridges(links_, part_); }
  Walked result(std::int64_t contradictions) && {
    return {std::move(axial_), std::move(first_), std::move(part_), contradictions};
  }

 private:
  void walk_from(std::int32_t start) {
    std::priority_queue<Reached, std::vector<Reached>, std::greater<>> waiting;
    std::set<std::pair<std::int32_t, std::int32_t>> taken;
    waiting.push({0.0, start, {0, 0}, 0});
    while (!waiting.empty()) {
      const Reached here = waiting.top();
      waiting.pop();
      if (part_[here.cell] >= 0 || !taken.insert({here.place.q, here.place.r}).second) continue;
      axial_(here.cell, 0) = here.place.q, axial_(here.cell, 1) = here.place.r;
      first_[here.cell] = static_cast<std::int8_t>(here.first);
      part_[here.cell] = parts_;
      for (Index j = 0; j < STEPS; ++j) {
        const std::int32_t to = links_.neighbours(here.cell, j);
        if (to < 0 || part_[to] >= 0 || blocked_[to]) continue;
        const AxialStep step = axial_step(j, here.first);
        const int first = first_corner(links_.back(here.cell, j), {-step.q, -step.r});
        if (first < 0) continue;
        waiting.push({std::max(here.misfit, links_.misfit(here.cell, j)),
                      to,
                      {here.place.q + step.q, here.place.r + step.r},
                      first});
      }
    }
    ++parts_;
  }
  // The corner that is corner 0 of a cell whose link j is this axial step; -1 if there is none.
  static int first_corner(Index j, AxialStep step) {
    for (int first = 0; first < 3; ++first)
      if (axial_step(j, first) == step) return first;
    return -1;
  }

  const CellLinks& links_;
  View<const bool, 1> blocked_;
  Array<std::int32_t, 2> axial_;
  Array<std::int8_t, 1> first_;
  Array<std::int32_t, 1> part_;
  std::int32_t parts_ = 0;
};

}  // namespace

Walked walk_cells(const CellLinks& links, const WalkLimits& limits) {
  const Index count = links.neighbours.size();
  Array<bool, 1> blocked({count}, false);
  std::int64_t contradictions = 0;
  for (Index round = 0;; ++round) {
    Walk walk(links, blocked);
    walk.walk_all();
    Array<bool, 1> bad(blocked.view());
    const std::int64_t here = walk.update_contradicted(bad);
    contradictions += here;
    if (here == 0 || round >= limits.max_rounds) {
      walk.part_at_bridges();
      return std::move(walk).result(contradictions);
    }
    blocked = std::move(bad);
  }
}

}  // namespace cmp::numbering
