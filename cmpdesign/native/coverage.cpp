// The coverage engine of scenes: exact areas of polygons, blurred by splines, one side after the other.
#include "base/binding.hpp"

#include <cmath>
#include <cstring>

namespace cmp {

namespace {

struct Spread {
  Index oversampling, reach, degree;
  View<const float, 1> weights;

  CMP_RECORD("cmpdesign.scene.parts.optics.PointSpread", oversampling, reach, degree, weights)
};

struct CoverageTask {
  View<const double, 2> segments;     // (S, 4) sides u0, v0, u1, v1 in samples
  View<const std::int64_t, 1> owner;  // (S,) the polygon of each side
  View<const double, 2> values;       // (polygons, planes)
  Index columns, width;
  View<const double, 2> quadrature;  // (2, n) places and weights on a piece of a side
  Spread spread;

  CMP_RECORD("cmpdesign.scene.drawing.coverage_task.CoverageTask", segments, owner, values, columns, width,
             quadrature, spread)
};

constexpr int ALONG = 4,
              ACROSS = 5;  // splines that are not zero in a knot interval, along columns and along rows

struct Patch {
  std::array<std::array<double, ACROSS>, ALONG> of{};
  Index rows, columns;
};

// The four cubic B-splines that are not zero in a knot interval, at the fraction t, leftmost first.
std::array<double, ALONG> cubic_bsplines(double t) {
  const double s = 1.0 - t, tt = t * t, ss = s * s;
  return {ss * s / 6, (4 - 6 * tt + 3 * tt * t) / 6, (4 - 6 * ss + 3 * ss * s) / 6, tt * t / 6};
}

// The five quartic B-splines that are not zero in a knot interval, by one more recursion.
std::array<double, ACROSS> quartic_bsplines(double t) {
  const auto [a, b, c, d] = cubic_bsplines(t);
  const double s = 1.0 - t;
  return {s * a / 4, ((3 + t) * a + (1 + s) * b) / 4, ((2 + t) * b + (2 + s) * c) / 4,
          ((1 + t) * c + (3 + s) * d) / 4, t * d / 4};
}

// The first integer strictly beyond `start` in the direction of `step`.
double next_knot(double start, double step) {
  return step > 0.0 ? std::floor(start) + 1.0 : std::ceil(start) - 1.0;
}

// Adds value times patch at (row, column), clipped to the plane; columns left of it count in column 0.
void add_patch(View<float, 2> plane, const Patch& patch, double value, Index row, Index column) {
  const Index last_row = std::min(patch.rows, plane.size(0) - row);
  const Index last_column = std::min(patch.columns, plane.size(1) - column);
  for (Index j = std::max<Index>(0, -row); j < last_row; ++j)
    for (Index i = 0; i < last_column; ++i)
      plane(row + j, std::max<Index>(column + i, 0)) += static_cast<float>(value * patch.of[j][i]);
}

// One side of a polygon, in samples.
struct Side {
  double u0, v0, du, dv;
};

// Adds the piece of a side between the fractions `from` and `to`, which lies in one cell of samples, to the
// patch.
void add_piece(Patch& patch, const Side& side, View<const double, 2> quadrature, double from, double to,
               Index cell_u, Index cell_v, bool is_sharp) {
  for (Index k = 0; k < quadrature.size(1); ++k) {
    const double at = from + quadrature(0, k) * (to - from);
    const double share = quadrature(1, k) * (to - from) * side.dv;
    const double u = side.u0 + at * side.du - static_cast<double>(cell_u);
    const double v = side.v0 + at * side.dv - static_cast<double>(cell_v);
    if (is_sharp) {
      patch.of[0][0] += share * (1.0 - u);
      patch.of[0][1] += share * u;
      continue;
    }
    const auto across = quartic_bsplines(u);
    const auto along = cubic_bsplines(v);
    for (int j = 0; j < ALONG; ++j)
      for (int i = 0; i < ACROSS; ++i) patch.of[j][i] += share * along[j] * across[i];
  }
}

// Adds one side's differences along the rows to the band that starts at sample row `top`.
void add_side(View<float, 3> differences, const CoverageTask& task, Index s, Index top) {
  const Index rows = differences.size(1), columns = differences.size(2);
  const Index degree = task.spread.degree, half = degree / 2;
  const double u0 = task.segments(s, 0), v0 = task.segments(s, 1);
  const Side side{u0, v0, task.segments(s, 2) - u0, task.segments(s, 3) - v0};
  const double v1 = task.segments(s, 3);
  if (side.dv == 0.0) return;
  const auto reach_down = static_cast<Index>(std::floor(std::max(v0, v1))) - half + degree;
  const auto reach_up = static_cast<Index>(std::floor(std::min(v0, v1))) - half;
  if (reach_down < top || reach_up >= top + rows) return;
  double knot_u = next_knot(u0, side.du), knot_v = next_knot(v0, side.dv), t = 0.0;
  while (t < 1.0) {
    const double t_u = side.du != 0.0 ? (knot_u - u0) / side.du : 2.0, t_v = (knot_v - v0) / side.dv;
    const double end = std::min({t_u, t_v, 1.0});
    if (t_u <= end) knot_u += side.du > 0.0 ? 1.0 : -1.0;
    if (t_v <= end) knot_v += side.dv > 0.0 ? 1.0 : -1.0;
    if (end <= t) continue;
    const auto cell_u = static_cast<Index>(std::floor(u0 + 0.5 * (t + end) * side.du));
    const auto cell_v = static_cast<Index>(std::floor(v0 + 0.5 * (t + end) * side.dv));
    const Index row = cell_v - half - top, column = cell_u - half;
    if (row + degree >= 0 && row < rows && column < columns) {
      Patch patch{{}, degree + 1, degree + 2};
      add_piece(patch, side, task.quadrature, t, end, cell_u, cell_v, degree == 0);
      for (Index plane = 0; plane < differences.size(0); ++plane) {
        const double value = task.values(task.owner[s], plane);
        if (value != 0.0) add_patch(differences[plane], patch, value, row, column);
      }
    }
    t = end;
  }
}

// Sixteen numbers, as many as the widest registers of a processor hold.
using Lanes = float __attribute__((vector_size(64)));
constexpr Index LANES = 16, GROUPS = 4;

// Lines of samples with a weight each, of a point spread.
struct WeightedLines {
  View<const float, 1> weights;
  const float* first;
  std::array<Index, 2> steps;  // samples from a line to the next, and where a period of lines is over
  Index period;

  const float* line(Index k) const { return first + k % period * steps[0] + k / period * steps[1]; }
};

// Writes the weighted sum of the lines. The sums stay in registers.
void fill_weighted_sum(const WeightedLines& lines, View<float, 1> out) {
  constexpr Index BLOCK = LANES * GROUPS;
  const Index count = out.size(), whole = count / BLOCK * BLOCK;
  for (Index x = 0; x < whole; x += BLOCK) {
    Lanes total0{}, total1{}, total2{}, total3{}, own;
    for (Index k = 0; k < lines.weights.size(); ++k) {
      const float weight = lines.weights[k];
      const float* const from = lines.line(k) + x;
      std::memcpy(&own, from, sizeof own);
      total0 += weight * own;
      std::memcpy(&own, from + LANES, sizeof own);
      total1 += weight * own;
      std::memcpy(&own, from + 2 * LANES, sizeof own);
      total2 += weight * own;
      std::memcpy(&own, from + 3 * LANES, sizeof own);
      total3 += weight * own;
    }
    const std::array<Lanes, GROUPS> totals{total0, total1, total2, total3};
    std::memcpy(out.data() + x, totals.data(), sizeof totals);
  }
  for (Index x = whole; x < count; ++x) {
    float total = 0.0F;
    for (Index k = 0; k < lines.weights.size(); ++k) total += lines.weights[k] * lines.line(k)[x];
    out[x] = total;
  }
}

constexpr Index ROWS = 4;  // summed at once: one sum alone waits for its own last addition

// Writes the sums along rows (ROWS, columns) into the phases of each, (ROWS, oversampling, samples).
//
// Samples of the same phase are adjacent, so that the second point spread runs over contiguous memory.
void fill_phases(View<const float, 2> lines, View<float, 3> phases) {
  const Index columns = lines.size(1), oversampling = phases.size(1);
  std::array<double, ROWS> totals{};
  Index x = 0;
  for (Index sample = 0; x < columns; ++sample) {
    for (Index phase = 0; phase < oversampling && x < columns; ++phase, ++x) {
      for (Index row = 0; row < ROWS; ++row) {
        totals[row] += lines(row, x);
        phases(row, phase, sample) = static_cast<float>(totals[row]);
      }
    }
  }
}

// Point spread down the columns, cumulative sum along the rows, point spread along the rows.
Array<float, 3> apply_point_spread(View<const float, 3> differences, const Spread& spread, Index count,
                                   Index width) {
  const Index planes = differences.size(0), columns = differences.size(2), oversampling = spread.oversampling;
  Array<float, 3> image({planes, count, width});
  Array<float, 2> lines({ROWS, columns}, 0.0F);
  Array<float, 3> phases({ROWS, oversampling, columns / oversampling + 1}, 0.0F);
  for (Index plane = 0; plane < planes; ++plane) {
    for (Index y = 0; y < count; y += ROWS) {
      const Index rows = std::min(ROWS, count - y);
      for (Index row = 0; row < rows; ++row) {
        const float* const top = differences[plane][oversampling * (y + row)].data();
        run_loop<fill_weighted_sum>(WeightedLines{spread.weights, top, {columns, columns}, 1}, lines[row]);
      }
      fill_phases(lines, phases);
      for (Index row = 0; row < rows; ++row) {
        const WeightedLines shifted{spread.weights, phases[row].data(), {phases.size(2), 1}, oversampling};
        run_loop<fill_weighted_sum>(shifted, image[plane][y + row]);
      }
    }
  }
  return image;
}

// Pixel rows `first` to `first + count` as (planes, count, width).
Array<float, 3> draw_band(const CoverageTask& task, Index first, Index count) {
  const Index rows = task.spread.oversampling * (count - 1) + 2 * task.spread.reach + 1;
  Array<float, 3> differences({task.values.size(1), rows, task.columns}, 0.0F);
  for (Index s = 0; s < task.segments.size(); ++s)
    add_side(differences, task, s, task.spread.oversampling * first);
  return apply_point_spread(differences, task.spread, count, task.width);
}

}  // namespace

void add_coverage(nb::module_ module) { bind<&draw_band>(module, "draw_band", {"task", "first", "count"}); }

}  // namespace cmp
