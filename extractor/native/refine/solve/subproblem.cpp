#include "refine/solve/subproblem.hpp"

namespace cmp::refine {

Array<std::int64_t, 1> gridlines_at(View<const bool, 1> selected, View<const std::int32_t, 2> edges) {
  Array<std::int64_t, 1> out({edges.size()});
  const auto found = out.view();
  Index count = 0;
  for (Index e = 0; e < edges.size(); ++e) {
    found[count] = e;
    count += selected[edges(e, 0)] || selected[edges(e, 1)];
  }
  return out.first(count);
}

SubproblemNumbering number_subproblem(View<const std::int64_t, 1> gridlines,
                                      View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes) {
  Array<std::int32_t, 1> number({spokes.size()}, -1), place({edges.size()}, -1);
  Array<std::int64_t, 1> markers({spokes.size()});
  Array<std::int32_t, 2> ends({gridlines.size(), 2});
  std::int32_t count = 0;
  for (Index k = 0; k < gridlines.size(); ++k) {
    place[gridlines[k]] = static_cast<std::int32_t>(k);
    for (Index side = 0; side < 2; ++side) {
      const Index m = edges(gridlines[k], side);
      if (number[m] < 0) {
        number[m] = count;
        markers[count] = m;
        ++count;
      }
      ends(k, side) = number[m];
    }
  }
  Array<std::int32_t, 2> around({count, spokes.size(1)}, -1);
  for (Index k = 0; k < count; ++k) {
    for (Index i = 0; i < spokes.size(1); ++i) {
      const Index e = spokes(markers[k], i);
      around(k, i) = e >= 0 ? place[e] : -1;
    }
  }
  return {markers.first(count), std::move(ends), std::move(around)};
}

}  // namespace cmp::refine
