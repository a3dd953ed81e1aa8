// Links that the inks contradict: at most one cell of each ink meets at a marker (eq. 4 of the article).
#pragma once

#include "base/array.hpp"
#include "numbering/lattice_walk.hpp"

namespace cmp::numbering {

// (N, 6) whether the colors contradict a link.
//
// Of a cell's six neighbours three are of the next class, (q - r) mod 3, and three of the class before. A
// link is contradicted where the neighbour looks like the cell itself or like neighbours of the other class,
// and not like those of its own. light (N, 3), NaN unknown.
Array<bool, 2> contradicted_links(const CellLinks& links, View<const double, 2> light,
                                  const LinkInkLimits& limits);

}  // namespace cmp::numbering
