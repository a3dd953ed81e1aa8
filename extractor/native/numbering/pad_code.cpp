#include "numbering/pad_code.hpp"

#include <bit>
#include <limits>
#include <vector>

namespace cmp::numbering {

namespace {

constexpr std::int32_t TURNS = 3, ROW_BITS = 64;

struct Place {
  std::int32_t q, r;
};

Place turned_down(Place a, std::int32_t turns) {
  for (std::int32_t k = 0; k < turns; ++k) a = {-a.q - a.r, a.q - 1};
  return a;
}

// Whether a turn and a shift keep the class (q - r) mod 3 of colored cells, that is, their inks.
bool keeps_inks(std::int32_t turns, std::int32_t dq, std::int32_t dr) {
  Place up{0, 0};
  for (std::int32_t k = 0; k < turns; ++k) up = {-up.q - up.r - 1, up.q};
  return (up.q - up.r + dq - dr) % 3 == 0;
}

std::uint64_t shifted(std::uint64_t row, std::int32_t by) {
  if (by >= ROW_BITS || by <= -ROW_BITS) return 0;
  return by >= 0 ? row << by : row >> -by;
}

// The cells of a part after turns, as rows of bits; cells beyond 64 columns are left out.
class Part {
 public:
  Part(View<const std::int32_t, 2> axial, View<const std::int8_t, 1> bit, std::int32_t turns) {
    std::vector<Place> places;
    std::int32_t high = std::numeric_limits<std::int32_t>::min();
    for (Index i = 0; i < axial.size(); ++i) {
      const Place a = turned_down({axial(i, 0), axial(i, 1)}, turns);
      low_q = std::min(low_q, a.q), low_r = std::min(low_r, a.r), high = std::max(high, a.r);
      places.push_back(a);
    }
    rows = places.empty() ? 0 : high - low_r + 1;
    for (auto* board : {&all, &known, &white}) board->assign(static_cast<std::size_t>(rows), 0);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const std::int32_t column = places[i].q - low_q, row = places[i].r - low_r;
      if (column >= ROW_BITS) continue;
      const std::uint64_t mask = std::uint64_t{1} << column;
      all[row] |= mask;
      if (bit[static_cast<Index>(i)] >= 0) known[row] |= mask;
      if (bit[static_cast<Index>(i)] > 0) white[row] |= mask, ++whites;
    }
  }

  std::vector<std::uint64_t> all, known, white;
  std::int32_t low_q = std::numeric_limits<std::int32_t>::max(), low_r = low_q, rows = 0, whites = 0;
};

struct Scored {
  std::int32_t turns, dq, dr, wrong;
};

}  // namespace

CodeMotions code_motions(View<const std::int32_t, 2> axial, View<const std::int8_t, 1> bit,
                         const CodeBoard& board, std::int64_t least_inside, bool are_inks_known,
                         std::int64_t most) {
  const auto side = static_cast<std::int32_t>(board.white.size());
  const auto origin = static_cast<std::int32_t>(board.origin);
  std::vector<Scored> found;
  for (std::int32_t turns = 0; turns < TURNS; ++turns) {
    const Part part(axial, bit, turns);
    for (std::int32_t row = 1 - part.rows; row < side; ++row)
      for (std::int32_t column = 1 - ROW_BITS; column < side; ++column) {
        const std::int32_t dq = column - part.low_q - origin, dr = row - part.low_r - origin;
        if (are_inks_known && !keeps_inks(turns, dq, dr)) continue;
        const std::int32_t first = std::max(0, -row), last = std::min(part.rows, side - row);
        std::int64_t inside = 0;
        for (std::int32_t k = first; k < last; ++k)
          inside += std::popcount(shifted(part.all[k], column) & board.cells[row + k]);
        if (inside < least_inside) continue;
        std::int32_t wrong = part.whites;
        for (std::int32_t k = first; k < last; ++k) {
          const std::uint64_t white = shifted(part.white[k], column), of_layout = board.white[row + k];
          wrong += std::popcount(of_layout & shifted(part.known[k], column) & ~white);
          wrong -= std::popcount(of_layout & white);
        }
        found.push_back({turns, dq, dr, wrong});
      }
  }
  const auto count = std::min<std::size_t>(found.size(), static_cast<std::size_t>(most));
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count), found.end(),
                    [](const Scored& a, const Scored& b) {
                      return std::tie(a.wrong, a.turns, a.dq, a.dr) < std::tie(b.wrong, b.turns, b.dq, b.dr);
                    });
  const auto kept = static_cast<Index>(count);
  Array<std::int32_t, 2> motions({kept, 3});
  Array<std::int32_t, 1> wrong({kept});
  for (Index k = 0; k < kept; ++k) {
    const Scored& motion = found[static_cast<std::size_t>(k)];
    motions(k, 0) = motion.turns, motions(k, 1) = motion.dq, motions(k, 2) = motion.dr;
    wrong[k] = motion.wrong;
  }
  return {std::move(motions), std::move(wrong)};
}

}  // namespace cmp::numbering
