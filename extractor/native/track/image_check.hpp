// The check of predicted cells by the image: a cell must show its own ink inside and none of it across its
// edges.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "track/warm_tables.hpp"

namespace cmp::track {

// Verdicts on a cell; twins of the constants in extractor/track/image_check.py.
inline constexpr std::uint8_t UNSEEN = 0, CONTRADICTED = 1, CONFIRMED = 2;

// The limits of the check; the Python module explains them.
struct CheckLimits {
  double min_white_ratio;
  double min_cosine;
  double min_strength;
  double max_strength;
  double inner_sample_position;
  double min_inner_strength;
  double level_radius;
  double smallest_square;

  template <class F>
  static CheckLimits read(const F& f) {
    return {f["min_white_ratio"],       f["min_cosine"],         f["min_strength"], f["max_strength"],
            f["inner_sample_position"], f["min_inner_strength"], f["level_radius"], f["smallest_square"]};
  }
};

// The verdicts (C,), the cell levels (2, C, 3), and the numbers of edges across which the white cell is
// bright, is not bright, and a black cell is as bright as white.
using CellCheck =
    std::tuple<Array<std::uint8_t, 1>, Array<double, 3>, std::int64_t, std::int64_t, std::int64_t>;

// The check of the cells with the corners xy (C, 3, 2), NaN where not predicted.
//
// image (H, W, 3) BGR; before (C, 3) ink levels over black in the previous frame, used if `compare`.
CellCheck check_cells(View<const std::uint8_t, 3> image, View<const double, 3> xy, const WarmTables& tables,
                      View<const double, 2> before, bool compare, const CheckLimits& limits);

}  // namespace cmp::track
