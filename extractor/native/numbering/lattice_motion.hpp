// Motions of the lattice of colored cells: turns by 120 degrees about marker 0, and shifts.
#pragma once

#include "base/array.hpp"

namespace cmp::numbering {

inline constexpr std::int32_t TURNS = 3;

// An axial place, or a step between two.
struct AxialStep {
  std::int32_t q, r;

  friend bool operator==(const AxialStep&, const AxialStep&) = default;
};

struct Motion {
  std::int32_t turn, dq, dr;
};

// The place of an up-cell after turns.
inline AxialStep turned_up(AxialStep a, std::int32_t turns) {
  for (std::int32_t k = 0; k < turns; ++k) a = {-a.q - a.r - 1, a.q};
  return a;
}

// The place of a down-cell after turns.
inline AxialStep turned_down(AxialStep a, std::int32_t turns) {
  for (std::int32_t k = 0; k < turns; ++k) a = {-a.q - a.r, a.q - 1};
  return a;
}

inline AxialStep moved_up(AxialStep a, const Motion& motion) {
  const AxialStep turned = turned_up(a, motion.turn);
  return {turned.q + motion.dq, turned.r + motion.dr};
}

// The down-cell that a motion carries to this place.
inline AxialStep moved_back_down(AxialStep a, const Motion& motion) {
  return turned_down({a.q - motion.dq, a.r - motion.dr}, (TURNS - motion.turn) % TURNS);
}

// The class (q - r) mod 3 of a cell; the pattern's inks red, green, blue are the classes 0, 1, 2.
inline Index class_of(AxialStep a) { return ((a.q - a.r) % 3 + 3) % 3; }

}  // namespace cmp::numbering
