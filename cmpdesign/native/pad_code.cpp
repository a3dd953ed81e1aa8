// The search of a pad's code: which black cells become white; see `patterns/pad_code.py`.
#include "base/binding.hpp"

#include <bit>
#include <cstdint>
#include <numeric>
#include <vector>

namespace cmp {

namespace {

using Windows = View<const std::int32_t, 2>;
using Rows = View<const std::int32_t, 1>;

constexpr Index WORD_BITS = 64;
constexpr Index NONE = -1;

// Numbers of the generator SplitMix64 (Steele et al., OOPSLA 2014): integers, the same on every machine.
class Numbers {
 public:
  explicit Numbers(std::uint64_t seed) : state_(seed) {}
  // an integer from 0 to count - 1
  Index below(Index count) {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return static_cast<Index>((z ^ (z >> 31)) % static_cast<std::uint64_t>(count));
  }

 private:
  std::uint64_t state_;
};

// A code and the penalty of its windows: the sum, over pairs of windows, of the squares of what their Hamming
// distance lacks of the wanted distance.
class Search {
 public:
  Search(Windows windows, Index cells, Index wanted)
      : windows_(windows),
        wanted_(wanted),
        words_((windows.size(1) + WORD_BITS - 1) / WORD_BITS),
        content_({windows.size(), words_}, 0),
        lacks_({windows.size()}, 0),
        is_touched_({windows.size()}, 0),
        is_white_({cells}, 0),
        uses_(static_cast<std::size_t>(cells)) {
    for (Index w = 0; w < windows.size(); ++w)
      for (Index bit = 0; bit < windows.size(1); ++bit) uses_[windows(w, bit)].push_back({w, bit});
  }

  const Array<std::uint8_t, 1>& is_white() const { return is_white_; }
  std::int64_t penalty() const { return penalty_; }

  void flip(Index cell) {
    is_white_[cell] ^= 1;
    for (const Use use : uses_[cell])
      content_(use.window, use.bit / WORD_BITS) ^= std::uint64_t{1} << (use.bit % WORD_BITS);
  }

  void add_all_penalties() {
    for (Index w = 0; w < windows_.size(); ++w) touch(w);
    add_touched(1);
    clear_touched();
  }

  // a cell of a window that lacks distance; some window must lack distance
  Index cell_to_change(Numbers& numbers) const {
    Index w = numbers.below(windows_.size());
    while (lacks_[w] == 0) w = w + 1 < windows_.size() ? w + 1 : 0;
    return windows_(w, numbers.below(windows_.size(1)));
  }

  // Exchanges the colors of two cells unless the penalty grows.
  void exchange(Index first, Index second) {
    for (const Index cell : {first, second})
      for (const Use use : uses_[cell]) touch(use.window);
    const std::int64_t before = penalty_;
    change_touched(first, second);
    if (penalty_ > before) change_touched(first, second);
    clear_touched();
  }

 private:
  struct Use {
    Index window, bit;
  };

  void touch(Index window) {
    if (is_touched_[window]) return;
    is_touched_[window] = 1;
    touched_.push_back(window);
  }
  void clear_touched() {
    for (const Index w : touched_) is_touched_[w] = 0;
    touched_.clear();
  }
  void change_touched(Index first, Index second) {
    add_touched(-1);
    flip(first);
    flip(second);
    add_touched(1);
  }

  // Adds or removes (sign -1) the penalties of all pairs that hold a touched window.
  void add_touched(int sign) {
    for (const Index a : touched_)
      for (Index b = 0; b < windows_.size(); ++b) {
        if (is_touched_[b] && b >= a) continue;
        const Index lack = wanted_ - distance(a, b);
        if (lack <= 0) continue;
        const std::int64_t change = sign * lack * lack;
        penalty_ += change;
        lacks_[a] += change;
        lacks_[b] += change;
      }
  }

  Index distance(Index a, Index b) const {
    Index found = 0;
    for (Index k = 0; k < words_; ++k) found += std::popcount(content_(a, k) ^ content_(b, k));
    return found;
  }

  Windows windows_;
  Index wanted_, words_;
  Array<std::uint64_t, 2> content_;
  Array<std::int64_t, 1> lacks_;  // the penalty of each window's pairs
  Array<std::uint8_t, 1> is_touched_, is_white_;
  std::vector<std::vector<Use>> uses_;  // of each cell
  std::vector<Index> touched_;
  std::int64_t penalty_ = 0;
};

// The cells of each ring but the fixed one; the first ones of a ring are white.
class Rings {
 public:
  Rings(Rows ring, Rows whites, Index fixed, Numbers& numbers)
      : members_(static_cast<std::size_t>(whites.size())) {
    for (Index cell = 0; cell < ring.size(); ++cell)
      if (cell != fixed) members_[ring[cell]].push_back(cell);
    for (std::vector<Index>& members : members_)
      for (std::size_t i = members.size(); i > 1; --i) std::swap(members[i - 1], members[numbers.below(i)]);
  }

  const std::vector<Index>& members(Index ring) const { return members_[ring]; }

 private:
  std::vector<std::vector<Index>> members_;
};

// A cell of the other color in the same ring, drawn evenly; NONE if there is none.
Index partner(Index cell, const std::vector<Index>& members, const Array<std::uint8_t, 1>& is_white,
              Numbers& numbers) {
  Index others = 0;
  for (const Index member : members) others += is_white[member] != is_white[cell];
  if (others == 0) return NONE;
  Index left = numbers.below(others);
  for (const Index member : members)
    if (is_white[member] != is_white[cell] && left-- == 0) return member;
  return NONE;
}

// (C,) 1 for the white ones of C black cells: such that any two windows differ in at least `wanted` cells;
// all 0 if no such choice is found within `steps` exchanges.
//
// windows (W, K): the cells of every window, in the order of their places. ring (C,): the ring of each cell.
// whites (R,): number of white cells of each ring besides `fixed`, a cell that is white always.
Array<std::uint8_t, 1> white_cells(Windows windows, Rows ring, Rows whites, Index fixed, Index wanted,
                                   Index steps, Index seed) {
  Search search(windows, ring.size(), wanted);
  Numbers numbers(static_cast<std::uint64_t>(seed));
  const Rings rings(ring, whites, fixed, numbers);
  search.flip(fixed);
  for (Index k = 0; k < whites.size(); ++k)
    for (Index i = 0; i < whites[k]; ++i) search.flip(rings.members(k)[i]);
  search.add_all_penalties();
  for (Index step = 0; step < steps && search.penalty() > 0; ++step) {
    const Index first = search.cell_to_change(numbers);
    if (first == fixed) continue;
    const Index second = partner(first, rings.members(ring[first]), search.is_white(), numbers);
    if (second != NONE) search.exchange(first, second);
  }
  Array<std::uint8_t, 1> found({ring.size()}, 0);
  if (search.penalty() == 0)
    for (Index i = 0; i < ring.size(); ++i) found[i] = search.is_white()[i];
  return found;
}

}  // namespace

void add_pad_code(nb::module_ module) {
  bind<&white_cells>(module, "white_cells",
                     {"windows", "ring", "whites", "fixed", "wanted", "steps", "seed"});
}

}  // namespace cmp
