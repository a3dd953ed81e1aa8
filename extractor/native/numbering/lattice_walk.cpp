#include "numbering/lattice_walk.hpp"

#include <array>
#include <queue>
#include <unordered_set>
#include <vector>

#include "cells/cell_mesh.hpp"
#include "layout/lattice_tables.hpp"
#include "numbering/lattice_motion.hpp"
#include "numbering/link_bridges.hpp"
#include "numbering/link_inks.hpp"

namespace cmp::numbering {

namespace {

using cells::STEP_CORNERS;
using cells::STEPS;
using layout::UNKNOWN_AXIAL;

constexpr int CORNER_AXIAL[3][2] = {{0, 0}, {1, 0}, {0, 1}};  // of an up-cell, as in the conventions

// The axial step of link j of a cell whose corner `first` is corner 0: at [j][first].
constexpr auto AXIAL_STEPS = [] {
  std::array<std::array<AxialStep, 3>, STEPS> out{};
  for (Index j = 0; j < STEPS; ++j)
    for (int first = 0; first < 3; ++first) {
      const int *from = CORNER_AXIAL[(STEP_CORNERS[j][0] + 3 - first) % 3],
                *to = CORNER_AXIAL[(STEP_CORNERS[j][1] + 3 - first) % 3];
      out[j][first] = {from[0] - to[0], from[1] - to[1]};
    }
  return out;
}();

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

// The extents of a part's places, and the number of its cells.
struct PartExtent {
  AxialStep low{INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN};
  std::int64_t cells = 0;
};

// The places without a cell that have at least `least` cells of a part around.
std::int64_t count_holes(View<const std::int32_t, 2> axial, View<const std::int32_t, 1> part,
                         std::int64_t least) {
  constexpr std::array<AxialStep, 6> AROUND{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, -1}, {-1, 1}}};
  std::vector<PartExtent> extents;
  for (Index i = 0; i < part.size(); ++i) {
    if (part[i] < 0) continue;
    if (part[i] >= static_cast<std::int32_t>(extents.size())) extents.resize(part[i] + 1);
    PartExtent& own = extents[part[i]];
    own.low = {std::min(own.low.q, axial(i, 0)), std::min(own.low.r, axial(i, 1))};
    own.high = {std::max(own.high.q, axial(i, 0)), std::max(own.high.r, axial(i, 1))};
    ++own.cells;
  }
  std::int64_t holes = 0;
  for (std::size_t one = 0; one < extents.size(); ++one) {
    const auto& [low, high, cells] = extents[one];
    if (cells <= least) continue;
    Array<bool, 2> here({high.q - low.q + 3, high.r - low.r + 3}, false);
    for (Index i = 0; i < part.size(); ++i)
      if (part[i] == static_cast<std::int32_t>(one))
        here(axial(i, 0) - low.q + 1, axial(i, 1) - low.r + 1) = true;
    for (Index q = 1; q + 1 < here.size(); ++q)
      for (Index r = 1; r + 1 < here.size(1); ++r) {
        std::int64_t around = 0;
        for (const AxialStep& step : AROUND) around += here(q + step.q, r + step.r);
        holes += !here(q, r) && around >= least;
      }
  }
  return holes;
}

class Walk {
 public:
  Walk(const CellLinks& links, View<const bool, 1> blocked)
      : links_(links),
        blocked_(blocked),
        axial_({blocked.size(), 2}, UNKNOWN_AXIAL),
        first_({blocked.size()}, std::int8_t{0}),
        part_({blocked.size()}, -1),
        best_(static_cast<std::size_t>(blocked.size()), Reached{0.0, -1, {0, 0}, 0}) {
    taken_.reserve(static_cast<std::size_t>(blocked.size()));
  }

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
        const AxialStep step = AXIAL_STEPS[j][first_[i]];
        if (axial_(to, 0) == axial_(i, 0) + step.q && axial_(to, 1) == axial_(i, 1) + step.r) continue;
        bad[i] = bad[to] = true;
        ++count;
      }
    }
    return count;
  }
  // Parts are what hangs together by loops of links: a single link may be false, and joins nothing.
  void part_at_bridges() { part_ = parts_without_bridges(links_, part_); }
  Walked result(std::int64_t contradictions, std::int64_t min_hole_neighbours) && {
    const std::int64_t holes = count_holes(axial_, part_, min_hole_neighbours);
    return {std::move(axial_), std::move(first_), std::move(part_), contradictions, holes};
  }

 private:
  void walk_from(std::int32_t start) {
    std::priority_queue<Reached, std::vector<Reached>, std::greater<>> waiting;
    waiting.push({0.0, start, {0, 0}, 0});
    while (!waiting.empty()) {
      const Reached here = waiting.top();
      waiting.pop();
      if (part_[here.cell] >= 0 || !taken_.insert(key_of(here.place)).second) continue;
      axial_(here.cell, 0) = here.place.q, axial_(here.cell, 1) = here.place.r;
      first_[here.cell] = static_cast<std::int8_t>(here.first);
      part_[here.cell] = parts_;
      for (Index j = 0; j < STEPS; ++j) {
        const std::int32_t to = links_.neighbours(here.cell, j);
        if (to < 0 || part_[to] >= 0 || blocked_[to]) continue;
        const AxialStep step = AXIAL_STEPS[j][here.first];
        const int first = first_corner(links_.back(here.cell, j), {-step.q, -step.r});
        if (first < 0) continue;
        const Reached next{std::max(here.misfit, links_.misfit(here.cell, j)),
                           to,
                           {here.place.q + step.q, here.place.r + step.r},
                           first};
        // a worse link to the same place changes nothing
        Reached& best = best_[static_cast<std::size_t>(to)];
        if (best.cell == parts_ && best.place == next.place && best.first == first &&
            best.misfit <= next.misfit)
          continue;
        if (best.cell != parts_ || next.misfit < best.misfit) best = {next.misfit, parts_, next.place, first};
        waiting.push(next);
      }
    }
    ++parts_;
  }
  // A number for each place of each part.
  std::uint64_t key_of(AxialStep place) const {
    constexpr std::uint64_t BITS = 21, MASK = (std::uint64_t{1} << BITS) - 1;
    return (static_cast<std::uint64_t>(parts_) << 2 * BITS) |
           ((static_cast<std::uint64_t>(place.q) & MASK) << BITS) |
           (static_cast<std::uint64_t>(place.r) & MASK);
  }
  // The corner that is corner 0 of a cell whose link j is this axial step; -1 if there is none.
  static int first_corner(Index j, AxialStep step) {
    for (int first = 0; first < 3; ++first)
      if (AXIAL_STEPS[j][first] == step) return first;
    return -1;
  }

  const CellLinks& links_;
  View<const bool, 1> blocked_;
  Array<std::int32_t, 2> axial_;
  Array<std::int8_t, 1> first_;
  Array<std::int32_t, 1> part_;
  std::vector<Reached> best_;  // how each cell can be reached; `cell` is the part from which
  std::unordered_set<std::uint64_t> taken_;
  std::int32_t parts_ = 0;
};

}  // namespace

Walked walk_cells(const CellLinks& all, View<const double, 2> light, const WalkLimits& limits) {
  const Array<bool, 2> contradicted = contradicted_links(all, light, limits.inks);
  Array<std::int32_t, 2> neighbours(all.neighbours);
  Array<std::int8_t, 2> back(all.back);
  for (Index k = 0; k < contradicted.count(); ++k)
    if (contradicted.view().flat()[k]) neighbours.flat()[k] = -1, back.flat()[k] = -1;
  const CellLinks links{neighbours, back, all.misfit};
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
      return std::move(walk).result(contradictions, limits.min_hole_neighbours);
    }
    blocked = std::move(bad);
  }
}

}  // namespace cmp::numbering
