// Moves that shorten a tour through cells with several entry points each; see `products/laser/paths/tour.py`.
#include "base/binding.hpp"

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace cmp {

namespace {

using Ints = View<std::int64_t, 1>;
using Points = View<const double, 2>;
using Neighbours = View<const std::int64_t, 2>;
using Entries = View<const double, 3>;

constexpr Index NONE = -1;       // before the first or after the last cell
constexpr int LONGEST_MOVE = 3;  // cells that an Or-opt move takes along

// An order of cells and the place of each cell in it.
class Tour {
 public:
  explicit Tour(Ints order) : order_(order), position_({order.size()}) { update_positions(0, order.size()); }

  Index count() const { return order_.size(); }
  Index position(Index cell) const { return position_[cell]; }
  // the cell at a place, or NONE
  Index at(Index place) const { return place >= 0 && place < count() ? order_[place] : NONE; }

  void reverse(Index start, Index end) {
    if (start >= end) return;
    std::reverse(order_.begin() + start, order_.begin() + end + 1);
    update_positions(start, end + 1);
  }

  // Moves the cells from `start` to `end` to place k, before (side -1) or after (side 1) the cell there. The
  // first or (not `is_first`) the last of the moved cells becomes the neighbour of the cell at k.
  void move(Index start, Index end, Index k, int side, bool is_first) {
    const Index target = k + (side > 0 ? 1 : 0);
    // after place k, the cell next to k comes first
    if (is_first != (side > 0)) std::reverse(order_.begin() + start, order_.begin() + end + 1);
    const auto first = order_.begin() + start, last = order_.begin() + end + 1, to = order_.begin() + target;
    if (target > end) {
      std::rotate(first, last, to);
      update_positions(start, target);
    } else {
      std::rotate(to, first, last);
      update_positions(target, end + 1);
    }
  }

 private:
  void update_positions(Index begin, Index end) {
    for (Index i = begin; i < end; ++i) position_[order_[i]] = i;
  }

  Ints order_;
  Array<std::int64_t, 1> position_;
};

// A tour between one point of each cell.
class PointTour {
 public:
  PointTour(Ints order, Points points, Neighbours neighbours, double min_gain)
      : tour_(order), points_(points), neighbours_(neighbours), min_gain_(min_gain) {}

  // Makes moves until none shortens the tour.
  void shorten() {
    for (bool is_changed = true; is_changed;) {
      is_changed = false;
      for (Index i = 0; i < tour_.count(); ++i) {
        const Index a = tour_.at(i);
        while (move_by_two_opt(a) || move_by_or_opt(a)) is_changed = true;
      }
    }
  }

 private:
  // 0 where one cell is NONE
  double distance(Index a, Index b) const {
    return a < 0 || b < 0 ? 0.0 : std::hypot(points_(a, 0) - points_(b, 0), points_(a, 1) - points_(b, 1));
  }

  // Makes one 2-opt move that joins cell a with a neighbour, on the side after or before a; false if none
  // helps.
  bool move_by_two_opt(Index a) {
    for (const int side : {1, -1}) {
      const Index i = tour_.position(a), b = tour_.at(i + side);
      const double before = distance(a, b);
      for (const Index c : neighbours_[a]) {
        const double joined = distance(a, c);
        if (b >= 0 && joined >= before) break;
        const Index k = tour_.position(c), d = tour_.at(k + side);
        if (!(before + distance(c, d) - joined - distance(b, d) > min_gain_)) continue;
        if (side > 0)
          tour_.reverse(std::min(i, k) + 1, std::max(i, k));
        else
          tour_.reverse(std::min(i, k), std::max(i, k) - 1);
        return true;
      }
    }
    return false;
  }

  // Makes one Or-opt move: a few cells from or to cell a move next to a neighbour; false if none helps.
  bool move_by_or_opt(Index a) {
    for (int size = 1; size <= LONGEST_MOVE; ++size)
      for (const bool is_first : {true, false}) {
        const Index start = is_first ? tour_.position(a) : tour_.position(a) - size + 1;
        if (start >= 0 && start + size <= tour_.count() && move_part(a, start, start + size - 1, is_first))
          return true;
      }
    return false;
  }

  // Moves the cells from `start` to `end`, of which a is the first or the last, next to a neighbour of a.
  bool move_part(Index a, Index start, Index end, bool is_first) {
    const Index far = tour_.at(is_first ? end : start), before = tour_.at(start - 1),
                after = tour_.at(end + 1);
    double removed = distance(before, tour_.at(start)) + distance(tour_.at(end), after);
    removed -= distance(before, after);
    if (removed <= min_gain_) return false;
    for (const Index c : neighbours_[a]) {
      const double joined = distance(a, c);
      if (joined >= removed) break;
      const Index k = tour_.position(c);
      if (start <= k && k <= end) continue;
      for (const int side : {-1, 1}) {
        Index m = k + side;
        if (start <= m && m <= end) m = side > 0 ? end + 1 : start - 1;
        const Index d = tour_.at(m);
        const double added = joined + distance(far, d) - distance(c, d);
        if (!(removed - added > min_gain_)) continue;
        tour_.move(start, end, k, side, is_first);
        return true;
      }
    }
    return false;
  }

  Tour tour_;
  Points points_;
  Neighbours neighbours_;
  double min_gain_;
};

// (N,) from cell 0, always the nearest of the remaining cells; centre (N, 2), N at least 1.
Array<std::int64_t, 1> nearest_neighbour_order(Points centre) {
  const Index count = centre.size();
  Array<std::int64_t, 1> order({count}), remaining({count});
  std::iota(remaining.begin(), remaining.end(), 0);
  Index nearest = 0;
  for (Index i = 0; i < count; ++i) {
    const Index cell = order[i] = remaining[nearest];
    remaining[nearest] = remaining[count - 1 - i];
    double shortest = std::numeric_limits<double>::infinity();
    nearest = 0;
    for (Index j = 0; j < count - 1 - i; ++j) {
      const double dx = centre(remaining[j], 0) - centre(cell, 0),
                   dy = centre(remaining[j], 1) - centre(cell, 1);
      const double d = dx * dx + dy * dy;
      if (d < shortest) {
        shortest = d;
        nearest = j;
      }
    }
  }
  return order;
}

// Makes 2-opt and Or-opt moves until no move shortens the tour by more than `min_gain`.
//
// order (N,): cells in order, updated. points (N, 2): entry point of each cell. neighbours (N, n): nearest
// cells.
void update_order(Ints order, Points points, Neighbours neighbours, double min_gain) {
  PointTour(order, points, neighbours, min_gain).shorten();
}

// (N,) the entry points with the shortest tour through the cells in this order (dynamic programming).
Array<std::int64_t, 1> best_entries(Entries entries, View<const std::int64_t, 1> order) {
  const Index count = order.size(), corners = entries.size(1);
  Array<std::int64_t, 2> predecessor({count, corners}, 0);
  std::vector<double> cost(static_cast<std::size_t>(corners), 0.0), reached(cost.size());
  for (Index i = 1; i < count; ++i) {
    const auto here = entries[order[i]], last = entries[order[i - 1]];
    std::fill(reached.begin(), reached.end(), std::numeric_limits<double>::infinity());
    for (Index k = 0; k < corners; ++k) {
      for (Index j = 0; j < corners; ++j) {
        const double d = cost[j] + std::hypot(here(k, 0) - last(j, 0), here(k, 1) - last(j, 1));
        if (d < reached[k]) {
          reached[k] = d;
          predecessor(i, k) = j;
        }
      }
    }
    std::swap(cost, reached);
  }
  Array<std::int64_t, 1> entry({count});
  Index corner = std::min_element(cost.begin(), cost.end()) - cost.begin();
  for (Index i = count - 1; i >= 0; --i) {
    entry[i] = corner;
    corner = predecessor(i, corner);
  }
  return entry;
}

// A tour between the entry points of the cells.
class EntryTour {
 public:
  EntryTour(Ints order, Ints entry, Entries entries, Neighbours neighbours, double min_gain)
      : tour_(order), entries_(entries), neighbours_(neighbours), min_gain_(min_gain), at_({order.size()}) {
    for (Index i = 0; i < order.size(); ++i) at_[order[i]] = entry[i];
  }

  Index entry(Index cell) const { return at_[cell]; }

  // Moves cell a to the place and the entry point that lengthen the tour least.
  void reinsert(Index a) {
    const Index i = tour_.position(a), before = tour_.at(i - 1), after = tour_.at(i + 1);
    const double removed = distance(before, a, entry(a)) + distance(after, a, entry(a)) - gap(before, after);
    Insertion best{removed - min_gain_, NONE, 0, 0};
    for (const Index c : neighbours_[a]) {
      for (const int side : {-1, 1}) {
        const Index d = tour_.at(tour_.position(c) + side);
        if (d == a) continue;
        for (Index corner = 0; corner < entries_.size(1); ++corner) {
          const double added = distance(c, a, corner) - gap(c, d) + distance(d, a, corner);
          if (added < best.added) best = {added, tour_.position(c), side, corner};
        }
      }
    }
    if (best.place == NONE) return;
    tour_.move(i, i, best.place, best.side, true);
    at_[a] = best.corner;
  }

 private:
  struct Insertion {
    double added;
    Index place;
    int side;
    Index corner;
  };

  // from cell b at its entry point to a corner of cell a; 0 for no cell
  double distance(Index b, Index a, Index corner) const {
    if (b < 0) return 0.0;
    return std::hypot(entries_(b, at_[b], 0) - entries_(a, corner, 0),
                      entries_(b, at_[b], 1) - entries_(a, corner, 1));
  }
  double gap(Index a, Index b) const { return b < 0 ? 0.0 : distance(a, b, at_[b]); }

  Tour tour_;
  Entries entries_;
  Neighbours neighbours_;
  double min_gain_;
  Array<std::int64_t, 1> at_;  // the entry point of each cell
};

// Moves each cell to the place and the entry point that lengthen the tour least, by more than `min_gain`.
//
// order, entry (N,): cells in order and their entry points, updated. entries (N, K, 2). neighbours (N, n).
void update_by_reinsertion(Ints order, Ints entry, Entries entries, Neighbours neighbours, double min_gain) {
  EntryTour tour(order, entry, entries, neighbours, min_gain);
  for (Index a = 0; a < order.size(); ++a) tour.reinsert(a);
  for (Index i = 0; i < order.size(); ++i) entry[i] = tour.entry(order[i]);
}

}  // namespace

void add_tour(nb::module_ module) {
  bind<&nearest_neighbour_order>(module, "nearest_neighbour_order", {"centre"});
  bind<&update_order>(module, "update_order", {"order", "points", "neighbours", "min_gain"});
  bind<&best_entries>(module, "best_entries", {"entries", "order"});
  bind<&update_by_reinsertion>(module, "update_by_reinsertion",
                               {"order", "entry", "entries", "neighbours", "min_gain"});
}

}  // namespace cmp
