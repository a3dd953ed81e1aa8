#include "numbering/link_bridges.hpp"

#include <vector>

#include "cells/cell_mesh.hpp"

namespace cmp::numbering {

namespace {

using cells::STEPS;

constexpr std::int32_t NEW = -1;

// A search in depth (Tarjan 1974, "A note on finding the bridges of a graph"): a cell from which no loop
// leads back before it is the first one of a part without bridges.
class BridgeSearch {
 public:
  BridgeSearch(const CellLinks& links, View<const std::int32_t, 1> part)
      : links_(links),
        part_(part),
        order_({part.size()}, NEW),
        low_({part.size()}, NEW),
        out_({part.size()}, NEW) {}

  Array<std::int32_t, 1> parts() && {
    for (Index i = 0; i < part_.size(); ++i)
      if (part_[i] >= 0 && order_[i] == NEW) search_from(static_cast<std::int32_t>(i));
    return std::move(out_);
  }

 private:
  struct Visit {
    std::int32_t cell;
    Index step = 0, step_to_last = STEPS;  // the next step, and the one that leads back
  };

  void enter(Visit visit) {
    order_[visit.cell] = low_[visit.cell] = count_++;
    visits_.push_back(visit);
    open_.push_back(visit.cell);
  }
  void search_from(std::int32_t start) {
    enter({start});
    while (!visits_.empty()) {
      Visit& here = visits_.back();
      if (here.step == STEPS) {
        leave();
        continue;
      }
      const Index step = here.step++;
      const std::int32_t to = links_.neighbours(here.cell, step);
      if (to < 0 || part_[to] != part_[here.cell] || step == here.step_to_last) continue;
      if (order_[to] == NEW)
        enter({to, 0, links_.back(here.cell, step)});
      else
        low_[here.cell] = std::min(low_[here.cell], order_[to]);
    }
  }
  void leave() {
    const std::int32_t cell = visits_.back().cell;
    visits_.pop_back();
    if (!visits_.empty()) low_[visits_.back().cell] = std::min(low_[visits_.back().cell], low_[cell]);
    if (low_[cell] != order_[cell]) return;
    const bool is_alone = open_.back() == cell;
    for (std::int32_t last = NEW; last != cell;) {
      last = open_.back();
      open_.pop_back();
      out_[last] = is_alone ? -1 : parts_;
    }
    parts_ += !is_alone;
  }

  const CellLinks& links_;
  View<const std::int32_t, 1> part_;
  Array<std::int32_t, 1> order_, low_, out_;
  std::vector<Visit> visits_;
  std::vector<std::int32_t> open_;
  std::int32_t count_ = 0, parts_ = 0;
};

}  // namespace

Array<std::int32_t, 1> parts_without_bridges(const CellLinks& links, View<const std::int32_t, 1> part) {
  return BridgeSearch(links, part).parts();
}

}  // namespace cmp::numbering
