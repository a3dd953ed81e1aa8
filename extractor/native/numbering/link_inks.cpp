#include "numbering/link_inks.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cells/cell_mesh.hpp"

namespace cmp::numbering {

namespace {

using cells::STEPS;

constexpr double FAR = std::numeric_limits<double>::infinity();
// The class of the neighbour at each step of cells::STEP_CORNERS, relative to the cell's; a turn does not
// change it.
constexpr int CLASS_STEP[STEPS] = {1, -1, -1, 1, -1, 1};

double distance(View<const double, 2> light, Index i, Index j) {
  double sum = 0.0;
  for (Index c = 0; c < 3; ++c) sum += std::abs(light(i, c) - light(j, c));
  return sum;
}

double strength(View<const double, 2> light, Index i) { return light(i, 0) + light(i, 1) + light(i, 2); }

// Whether the neighbour at a step of cell i looks like another class.
bool is_contradicted(const CellLinks& links, View<const double, 2> light, Index i, Index step,
                     const LinkInkLimits& limits) {
  const std::int32_t to = links.neighbours(i, step);
  if (!std::isfinite(light(to, 0)) || !std::isfinite(light(i, 0))) return false;
  double others = distance(light, i, to);
  double mates = FAR;
  bool has_mates = false;
  for (Index k = 0; k < STEPS; ++k) {
    const std::int32_t other = links.neighbours(i, k);
    if (k == step || other < 0 || !std::isfinite(light(other, 0))) continue;
    const double apart = distance(light, to, other);
    if (CLASS_STEP[k] == CLASS_STEP[step]) {
      mates = std::min(mates, apart);
      has_mates = true;
    } else {
      others = std::min(others, apart);
    }
  }
  const double least = limits.least_difference * std::max(strength(light, to), strength(light, i));
  if (!has_mates) return others < limits.likeness * least;
  return mates > least && others < limits.likeness * mates;
}

}  // namespace

Array<bool, 2> contradicted_links(const CellLinks& links, View<const double, 2> light,
                                  const LinkInkLimits& limits) {
  const Index count = links.neighbours.size();
  Array<bool, 2> bad({count, STEPS}, false);
  for (Index i = 0; i < count; ++i)
    for (Index step = 0; step < STEPS; ++step) {
      if (links.neighbours(i, step) < 0 || !is_contradicted(links, light, i, step, limits)) continue;
      bad(i, step) = true;
      bad(links.neighbours(i, step), links.back(i, step)) = true;
    }
  return bad;
}

}  // namespace cmp::numbering
