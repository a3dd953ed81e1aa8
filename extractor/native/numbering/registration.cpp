#include "numbering/registration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "layout/lattice_tables.hpp"
#include "numbering/lattice_motion.hpp"

namespace cmp::numbering {

namespace {

struct Extent {
  std::int32_t low, high;
};

// The extent of q, r or q + r over places, without a share of them at both ends.
Extent trimmed_extent(const std::vector<AxialStep>& places, int axis, double share) {
  std::vector<std::int32_t> values;
  values.reserve(places.size());
  for (const AxialStep& a : places) values.push_back(axis == 0 ? a.q : axis == 1 ? a.r : a.q + a.r);
  const auto cut = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
  const auto low = values.begin() + cut, high = values.end() - 1 - cut;
  std::nth_element(values.begin(), low, values.end());
  const std::int32_t lowest = *low;
  std::nth_element(low, high, values.end());
  return {lowest, *high};
}

struct ScoredMotion {
  std::int32_t pad;
  Motion motion;
  double score;
  double white;
  std::int32_t known;  // of its white places
};

// The numbers of axial places.
class AxialPlaces {
 public:
  explicit AxialPlaces(View<const std::int32_t, 2> axial) {
    for (Index n = 0; n < axial.size(); ++n) {
      const std::int32_t reach = std::max(std::abs(axial(n, 0)), std::abs(axial(n, 1)));
      reach_ = std::max(reach_, reach);
    }
    lookup_ = Array<std::int32_t, 2>({2 * reach_ + 1, 2 * reach_ + 1}, -1);
    for (Index n = 0; n < axial.size(); ++n)
      lookup_(axial(n, 0) + reach_, axial(n, 1) + reach_) = static_cast<std::int32_t>(n);
  }
  std::int32_t number_at(AxialStep a) const {
    if (std::abs(a.q) > reach_ || std::abs(a.r) > reach_) return -1;
    return lookup_(a.q + reach_, a.r + reach_);
  }

 private:
  std::int32_t reach_ = 0;
  Array<std::int32_t, 2> lookup_;
};

// A rectangle of axial places with a value at each; shifted places are read without a test.
template <class Value>
class AxialTable {
 public:
  AxialTable(Extent q, Extent r, Value none) : q_(q.low), r_(r.low), columns_(r.high - r.low + 1) {
    values_.assign(static_cast<std::size_t>((q.high - q.low + 1) * columns_), none);
  }
  std::ptrdiff_t index_of(AxialStep a) const { return (a.q - q_) * columns_ + a.r - r_; }
  std::ptrdiff_t step_of(std::int32_t dq, std::int32_t dr) const { return dq * columns_ + dr; }
  Value& operator[](std::ptrdiff_t index) { return values_[static_cast<std::size_t>(index)]; }
  Value operator[](std::ptrdiff_t index) const { return values_[static_cast<std::size_t>(index)]; }

 private:
  std::ptrdiff_t q_, r_, columns_;
  std::vector<Value> values_;
};

Extent together(Extent a, Extent b) { return {std::min(a.low, b.low), std::max(a.high, b.high)}; }

Extent extent_of(const std::vector<AxialStep>& places, int axis) {
  return places.empty() ? Extent{0, 0} : trimmed_extent(places, axis, 0.0);
}

std::vector<AxialStep> steps_of(View<const std::int32_t, 2> axial) {
  std::vector<AxialStep> out;
  out.reserve(static_cast<std::size_t>(axial.size()));
  for (Index n = 0; n < axial.size(); ++n) out.push_back({axial(n, 0), axial(n, 1)});
  return out;
}

// A part that was turned, before shifts.
struct TurnedPart {
  std::vector<AxialStep> cells, down;
};

// Scores the shifts of a turned part.
class Shifts {
 public:
  // Shifts are within dq and dr. white (D,) of the part's down-cells.
  Shifts(const TurnedPart& part, View<const double, 1> white, const std::vector<AxialStep>& layout,
         const std::vector<AxialStep>& layout_white, Extent dq, Extent dr)
      : is_cell_(together(extent_of(layout, 0), shifted(extent_of(part.cells, 0), dq, 1)),
                 together(extent_of(layout, 1), shifted(extent_of(part.cells, 1), dr, 1)), 0),
        odds_(together(extent_of(part.down, 0), shifted(extent_of(layout_white, 0), dq, -1)),
              together(extent_of(part.down, 1), shifted(extent_of(layout_white, 1), dr, -1)), {0.0, 0}) {
    for (const AxialStep& a : layout) is_cell_[is_cell_.index_of(a)] = 1;
    for (const AxialStep& a : part.cells) cell_.push_back(is_cell_.index_of(a));
    for (Index n = 0; n < white.size(); ++n)
      if (!std::isnan(white[n])) odds_[odds_.index_of(part.down[static_cast<std::size_t>(n)])] = {white[n], 1};
    for (const AxialStep& a : layout_white) white_.push_back(odds_.index_of(a));
  }
  // The number of cells outside the layout; -1 for more than `most`.
  std::int64_t count_outside(std::int32_t dq, std::int32_t dr, std::int64_t most) const {
    const auto step = is_cell_.step_of(dq, dr);
    std::int64_t outside = 0;
    for (const std::ptrdiff_t at : cell_)
      if (!is_cell_[at + step] && ++outside > most) return -1;
    return outside;
  }
  // Fills in the log odds of the known white places of each pad, and their numbers.
  void fill_white(std::int32_t dq, std::int32_t dr, View<const std::int32_t, 1> pad, std::vector<double>& odds,
                 std::vector<std::int32_t>& known) const {
    const auto step = odds_.step_of(dq, dr);
    const auto count = static_cast<Index>(white_.size());
    for (Index w = 0; w < count;) {
      const std::int32_t own = pad[w];
      KnownOdds sum{0.0, 0};
      for (; w < count && pad[w] == own; ++w) {
        const KnownOdds one = odds_[white_[static_cast<std::size_t>(w)] - step];
        sum.odds += one.odds, sum.known += one.known;
      }
      odds[own] = sum.odds, known[own] = sum.known;
    }
  }

 private:
  struct KnownOdds {
    double odds;
    std::int32_t known;
  };
  static Extent shifted(Extent places, Extent by, std::int32_t sign) {
    return sign > 0 ? Extent{places.low + by.low, places.high + by.high}
                    : Extent{places.low - by.high, places.high - by.low};
  }

  AxialTable<std::uint8_t> is_cell_;
  AxialTable<KnownOdds> odds_;
  std::vector<std::ptrdiff_t> cell_, white_;
};

// The best motions, the best first; of equal ones the first.
Motions best_motions(std::vector<ScoredMotion> found, Index most) {
  const Index count = std::min<Index>(static_cast<Index>(found.size()), most);
  std::vector<Index> order(found.size());
  std::iota(order.begin(), order.end(), 0);
  std::partial_sort(order.begin(), order.begin() + count, order.end(), [&](Index a, Index b) {
    return found[a].score > found[b].score || (found[a].score == found[b].score && a < b);
  });
  Array<std::int32_t, 2> motions({count, 3});
  Array<std::int32_t, 1> pads({count}), known({count});
  Array<double, 1> scores({count}), odds({count});
  for (Index k = 0; k < count; ++k) {
    const ScoredMotion& one = found[order[k]];
    motions(k, 0) = one.motion.turn, motions(k, 1) = one.motion.dq, motions(k, 2) = one.motion.dr;
    pads[k] = one.pad, scores[k] = one.score, odds[k] = one.white, known[k] = one.known;
  }
  double without_white = -std::numeric_limits<double>::infinity();
  for (std::size_t n = 1; n < order.size(); ++n)
    without_white = std::max(without_white, found[order[n]].score - found[order[n]].white);
  return {std::move(motions),
          std::move(pads),
          std::move(scores),
          std::move(odds),
          std::move(known),
          without_white,
          static_cast<Index>(found.size())};
}

}  // namespace

Motions register_part(View<const std::int32_t, 2> axial, View<const double, 1> naming,
                      View<const std::int32_t, 2> white_axial, View<const double, 1> white,
                      const RegisteredLayout& layout, const WitnessLimits& limits) {
  const auto most =
      std::max(limits.min_outside,
               static_cast<std::int64_t>(limits.max_outside_share * static_cast<double>(axial.size())));
  const auto cells = steps_of(axial), down = steps_of(white_axial), of_layout = steps_of(layout.axial),
             layout_white = steps_of(layout.white_axial);
  std::array<Extent, 3> allowed;
  for (int axis = 0; axis < 3; ++axis) allowed[axis] = trimmed_extent(of_layout, axis, 0.0);
  std::vector<ScoredMotion> found;
  const std::int32_t pads = layout.white_pad[layout.white_pad.size() - 1] + 1;
  std::vector<double> odds(pads);
  std::vector<std::int32_t> known(pads);
  for (std::int32_t turn = 0; turn < TURNS; ++turn) {
    TurnedPart part;
    for (const AxialStep& a : cells) part.cells.push_back(turned_up(a, turn));
    for (const AxialStep& a : down) part.down.push_back(turned_down(a, turn));
    std::array<Extent, 3> own;
    for (int axis = 0; axis < 3; ++axis)
      own[axis] = trimmed_extent(part.cells, axis, limits.trimmed_share);
    const Extent q{allowed[0].low - own[0].low, allowed[0].high - own[0].high},
        r{allowed[1].low - own[1].low, allowed[1].high - own[1].high};
    if (q.high < q.low || r.high < r.low) continue;
    const Shifts shifts(part, white, of_layout, layout_white, q, r);
    for (std::int32_t dq = q.low; dq <= q.high; ++dq)
      for (std::int32_t dr = r.low; dr <= r.high; ++dr) {
        if (own[2].low + dq + dr < allowed[2].low || own[2].high + dq + dr > allowed[2].high) continue;
        const std::int64_t outside = shifts.count_outside(dq, dr, most);
        if (outside < 0) continue;
        const Motion motion{turn, dq, dr};
        shifts.fill_white(dq, dr, layout.white_pad, odds, known);
        const Index shift = class_of(moved_up(cells[0], motion)) - class_of(cells[0]);
        const double others =
            naming[((shift % 3) + 3) % 3] - limits.outside_weight * static_cast<double>(outside);
        for (std::int32_t pad = 0; pad < pads; ++pad)
          found.push_back({pad, motion, others + odds[pad], odds[pad], known[pad]});
      }
  }
  return best_motions(std::move(found), limits.max_motions);
}

Array<std::int32_t, 1> cells_beside(View<const std::int32_t, 2> axial,
                                    View<const std::int32_t, 2> down_axial) {
  const AxialPlaces cells(axial);
  Array<std::int32_t, 1> out({down_axial.size()}, 0);
  for (Index n = 0; n < down_axial.size(); ++n) {
    const std::int32_t q = down_axial(n, 0), r = down_axial(n, 1);
    for (const AxialStep beside : {AxialStep{q, r}, {q - 1, r}, {q - 1, r + 1}})
      if (cells.number_at(beside) >= 0) ++out[n];
  }
  return out;
}

Array<std::int32_t, 1> moved_cells(View<const std::int32_t, 2> axial, std::int32_t turn, std::int32_t dq,
                                   std::int32_t dr, View<const std::int32_t, 2> cell_lookup) {
  Array<std::int32_t, 1> out({axial.size()});
  for (Index i = 0; i < axial.size(); ++i) {
    const AxialStep a = moved_up({axial(i, 0), axial(i, 1)}, {turn, dq, dr});
    out[i] = layout::cell_at(cell_lookup, a.q, a.r);
  }
  return out;
}

}  // namespace cmp::numbering
