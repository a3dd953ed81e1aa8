// A subproblem: some gridlines and the markers at their ends, numbered as if there were no others.
#pragma once

#include "base/array.hpp"

namespace cmp::refine {

// The markers of n gridlines, numbered among themselves.
struct SubproblemNumbering {
  Array<std::int64_t, 1> markers;  // (m,) the markers at the gridlines' ends
  Array<std::int32_t, 2> ends;     // (n, 2) places of each gridline's ends in `markers`
  Array<std::int32_t, 2> spokes;   // (m, 6) places of the gridlines at each marker among the n, -1 for none
};

// (n,) the gridlines with an end at a selected marker (M,); edges (E, 2).
Array<std::int64_t, 1> gridlines_at(View<const bool, 1> selected, View<const std::int32_t, 2> edges);

// The markers of gridlines (n,); edges (E, 2) and spokes (M, 6) as in Topology.
SubproblemNumbering number_subproblem(View<const std::int64_t, 1> gridlines,
                                      View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes);

// The rows of a table of double, std::int32_t or bool with these numbers (n,).
template <class T>
Array<T, 2> selected_rows(View<const T, 2> table, View<const std::int64_t, 1> numbers) {
  Array<T, 2> out({numbers.size(), table.size(1)});
  const auto rows = out.view();
  for (Index i = 0; i < numbers.size(); ++i) {
    for (Index k = 0; k < table.size(1); ++k) rows(i, k) = table(numbers[i], k);
  }
  return out;
}

}  // namespace cmp::refine
