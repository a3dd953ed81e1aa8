#include "refine/synthesis/gridline_sides.hpp"

#include <cmath>

#include "base/parts.hpp"
#include "image/response.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

namespace {

struct Point {
  double x, y;
};

using Channels = std::array<double, 4>;  // three of them, and a 0 that fills up a vector

// The middle of the chord of a gridline (8,), px.
Point chord_middle(View<const double, 1> line) {
  const double half = 0.5 * line[LENGTH];
  return {line[X] + half * line[UX], line[Y] + half * line[UY]};
}

// The centroid of a cell (3,), px.
Point cell_centroid(View<const double, 2> xy, View<const std::int32_t, 1> cell) {
  const Index a = cell[0], b = cell[1], c = cell[2];
  return {(xy(a, 0) + xy(b, 0) + xy(c, 0)) / 3, (xy(a, 1) + xy(b, 1) + xy(c, 1)) / 3};
}

}  // namespace

GridlineSides::GridlineSides(View<double, 2> lines, View<const double, 2> xy,
                             View<const std::int32_t, 2> cells, View<const std::int32_t, 2> edge_cells,
                             const image::PolynomialFrame& frame)
    : count_(lines.size()) {
  known_.reserve(static_cast<std::size_t>(count_));
  for (Index e = 0; e < count_; ++e) {
    const auto line = lines[e];
    if (line[KNOWN] == 0.0) continue;
    const auto [mx, my] = chord_middle(line);
    KnownGridline own{e, {}, monomials((mx - frame.x) / frame.scale, (my - frame.y) / frame.scale)};
    for (std::size_t k = 0; k < 2; ++k) {
      const Index i = edge_cells(e, k);
      own.neighbours[k].cell = i;
      if (i < 0) continue;
      const auto [cx, cy] = cell_centroid(xy, cells[i]);
      if (!std::isfinite(cx)) {
        // a cell with an unknown corner is not drawn, and no gridline beside that cell is read
        line[KNOWN] = 0.0;
        break;
      }
      const Index side = (cy - my) * line[UX] - (cx - mx) * line[UY] > 0.0 ? BEYOND : BEFORE;
      own.neighbours[k] = {i, side, mx - cx, my - cy};
    }
    if (line[KNOWN] != 0.0) known_.push_back(own);
  }
}

Array<double, 2> GridlineSides::light(const InkLevels& levels) const {
  Array<double, 2> sides({count_, SIDE_COLUMNS}, 0.0);
  const auto out = sides.view();
  const auto cell = levels.cell;
  const auto slope = levels.slope;
  const auto black = levels.black;
  std::array<Channels, POLYNOMIAL_TERMS> factors;
  for (Index k = 0; k < POLYNOMIAL_TERMS; ++k) factors[k] = {black(0, k), black(1, k), black(2, k), 0.0};
  const auto count = static_cast<Index>(known_.size());
  in_parts(count, count, [&](Index begin, Index end) {
    for (Index n = begin; n < end; ++n) {
      const KnownGridline& line = known_[static_cast<std::size_t>(n)];
      Channels level{};
      for (std::size_t k = 0; k < factors.size(); ++k) {
        for (std::size_t channel = 0; channel < level.size(); ++channel)
          level[channel] += line.terms[k] * factors[k][channel];
      }
      const auto own = out[line.edge];
      for (Index channel = 0; channel < 3; ++channel)
        own[BEFORE + channel] = own[BEYOND + channel] = level[channel];
      for (const auto& [i, side, x, y] : line.neighbours) {
        if (i < 0) continue;
        for (Index channel = 0; channel < 3; ++channel) {
          const double rise = slope(i, channel, 0) * x + slope(i, channel, 1) * y;
          own[side + channel] += cell(i, channel) + rise;
        }
      }
    }
  });
  return sides;
}

Array<double, 2> value_contrasts(View<const double, 2> sides, View<const float, 1> encoded) {
  Array<double, 2> out({sides.size(), 3});
  for (Index e = 0; e < sides.size(); ++e) {
    for (Index channel = 0; channel < 3; ++channel) {
      const auto before = static_cast<float>(sides(e, BEFORE + channel));
      const auto beyond = static_cast<float>(sides(e, BEYOND + channel));
      const float contrast = encoded[image::table_place(before)] - encoded[image::table_place(beyond)];
      out(e, channel) = static_cast<double>(contrast);
    }
  }
  return out;
}

}  // namespace cmp::refine
