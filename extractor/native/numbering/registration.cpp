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

// The number of places inside the layout after a shift; -1 where more than `most` lie outside.
std::int64_t count_inside(const std::vector<AxialStep>& places, std::int32_t dq, std::int32_t dr,
                          std::int64_t most, View<const std::int32_t, 2> cell_lookup) {
  std::int64_t outside = 0;
  for (const AxialStep& a : places)
    if (layout::cell_at(cell_lookup, a.q + dq, a.r + dr) < 0 && ++outside > most) return -1;
  return static_cast<std::int64_t>(places.size()) - outside;
}

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
  const AxialPlaces places(white_axial);
  const auto most =
      std::max(limits.min_outside,
               static_cast<std::int64_t>(limits.max_outside_share * static_cast<double>(axial.size())));
  std::vector<AxialStep> cells, of_layout;
  for (Index i = 0; i < axial.size(); ++i) cells.push_back({axial(i, 0), axial(i, 1)});
  for (Index u = 0; u < layout.axial.size(); ++u)
    of_layout.push_back({layout.axial(u, 0), layout.axial(u, 1)});
  std::array<Extent, 3> allowed;
  for (int axis = 0; axis < 3; ++axis) allowed[axis] = trimmed_extent(of_layout, axis, 0.0);
  std::vector<ScoredMotion> found;
  const std::int32_t pads = layout.white_pad[layout.white_pad.size() - 1] + 1;
  std::vector<double> odds(pads);
  std::vector<std::int32_t> known(pads);
  for (std::int32_t turn = 0; turn < TURNS; ++turn) {
    std::vector<AxialStep> turned;
    for (const AxialStep& a : cells) turned.push_back(turned_up(a, turn));
    std::array<Extent, 3> own;
    for (int axis = 0; axis < 3; ++axis) own[axis] = trimmed_extent(turned, axis, limits.trimmed_share);
    for (std::int32_t dq = allowed[0].low - own[0].low; dq <= allowed[0].high - own[0].high; ++dq)
      for (std::int32_t dr = allowed[1].low - own[1].low; dr <= allowed[1].high - own[1].high; ++dr) {
        if (own[2].low + dq + dr < allowed[2].low || own[2].high + dq + dr > allowed[2].high) continue;
        const std::int64_t inside = count_inside(turned, dq, dr, most, layout.cell_lookup);
        if (inside < 0) continue;
        const Motion motion{turn, dq, dr};
        std::fill(odds.begin(), odds.end(), 0.0);
        std::fill(known.begin(), known.end(), 0);
        for (Index w = 0; w < layout.white_axial.size(); ++w) {
          const std::int32_t place =
              places.number_at(moved_back_down({layout.white_axial(w, 0), layout.white_axial(w, 1)}, motion));
          if (place < 0 || std::isnan(white[place])) continue;
          odds[layout.white_pad[w]] += white[place], ++known[layout.white_pad[w]];
        }
        const Index shift = class_of(moved_up(cells[0], motion)) - class_of(cells[0]);
        const double others = naming[((shift % 3) + 3) % 3] -
                              limits.outside_weight * static_cast<double>(axial.size() - inside);
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

Array<std::int32_t, 1> moved_cells(const WalkedCells& cells, std::int32_t part,
                                   View<const std::int32_t, 1> motion,
                                   View<const std::int32_t, 2> cell_lookup) {
  Array<std::int32_t, 1> out({cells.part.size()}, -1);
  for (Index i = 0; i < out.size(); ++i) {
    if (cells.part[i] != part) continue;
    const AxialStep a = moved_up({cells.axial(i, 0), cells.axial(i, 1)}, {motion[0], motion[1], motion[2]});
    out[i] = layout::cell_at(cell_lookup, a.q, a.r);
  }
  return out;
}

}  // namespace cmp::numbering
