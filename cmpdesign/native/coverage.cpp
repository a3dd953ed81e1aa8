// The coverage engine of scenes: exact areas of polygons, blurred by splines, one side after the other.
#include "base/binding.hpp"

#include <cmath>
#include <cstring>
#include <vector>

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

// Four numbers: those of the four places of a quadrature, or of the first four splines along a row.
using Four = double __attribute__((vector_size(32)));
using FourFloats = float __attribute__((vector_size(16)));

constexpr Index ALONG = 4,
                ACROSS = 5;  // splines that are not zero in a knot interval: down columns, along rows
constexpr Index PLACES = 4;  // of the quadrature that is exact for cubic splines

// Sums over a piece of a side: of the row's first four samples, and of the last one of all rows.
struct Patch {
  Four first[ALONG]{}, last{};
};

// The four cubic B-splines that are not zero in a knot interval, at the fractions t, leftmost first.
CMP_PART_OF_LOOP void fill_cubic(const Four& t, Four (&out)[ALONG]) {
  const Four s = 1.0 - t, tt = t * t, ss = s * s;
  out[0] = ss * s / 6.0;
  out[1] = (4.0 - 6.0 * tt + 3.0 * tt * t) / 6.0;
  out[2] = (4.0 - 6.0 * ss + 3.0 * ss * s) / 6.0;
  out[3] = tt * t / 6.0;
}

// The five quartic B-splines that are not zero in a knot interval, by one more recursion.
CMP_PART_OF_LOOP void fill_quartic(const Four& t, Four (&out)[ACROSS]) {
  Four of[ALONG];
  fill_cubic(t, of);
  const Four s = 1.0 - t;
  out[0] = s * of[0] / 4.0;
  out[1] = ((3.0 + t) * of[0] + (1.0 + s) * of[1]) / 4.0;
  out[2] = ((2.0 + t) * of[1] + (2.0 + s) * of[2]) / 4.0;
  out[3] = ((1.0 + t) * of[2] + (3.0 + s) * of[3]) / 4.0;
  out[4] = t * of[3] / 4.0;
}

// The first integer strictly beyond `start` in the direction of `step`.
double next_knot(double start, double step) {
  return step > 0.0 ? std::floor(start) + 1.0 : std::ceil(start) - 1.0;
}

// Adds a number at (row, column) if it is in the plane; columns left of the plane count in column 0.
CMP_PART_OF_LOOP void add_sample(View<float, 2> plane, double value, Index row, Index column) {
  if (row >= 0 && row < plane.size(0) && column < plane.size(1))
    plane(row, std::max<Index>(column, 0)) += static_cast<float>(value);
}

// Adds value times patch at (row, column).
CMP_PART_OF_LOOP void add_patch(View<float, 2> plane, const Patch& patch, double value, Index row,
                                Index column) {
  const bool is_inside = column >= 0 && column + ACROSS <= plane.size(1);
  const Four last = value * patch.last;
  for (Index j = 0; j < ALONG; ++j) {
    const Four first = value * patch.first[j];
    if (is_inside && row + j >= 0 && row + j < plane.size(0)) {
      float* const at = &plane(row + j, column);
      FourFloats sum;
      std::memcpy(&sum, at, sizeof sum);
      sum += __builtin_convertvector(first, FourFloats);
      std::memcpy(at, &sum, sizeof sum);
      at[ALONG] += static_cast<float>(last[j]);
      continue;
    }
    for (Index i = 0; i < ALONG; ++i) add_sample(plane, first[i], row + j, column + i);
    add_sample(plane, last[j], row + j, column + ALONG);
  }
}

// One side of a polygon, in samples.
struct Side {
  double u0, v0, du, dv;
};

// A piece of a side between two fractions of its length, which lies in one cell of samples.
struct Piece {
  double from, to;
  Index cell_u, cell_v;
};

// Sums the contour integral over a piece by quadrature.
CMP_PART_OF_LOOP void fill_patch(const Side& side, const Piece& piece, View<const double, 2> quadrature,
                                 Patch& patch) {
  Four place, weight;
  std::memcpy(&place, &quadrature(0, 0), sizeof place);
  std::memcpy(&weight, &quadrature(1, 0), sizeof weight);
  const Four at = piece.from + place * (piece.to - piece.from);
  const Four share = weight * (piece.to - piece.from) * side.dv;
  Four across[ACROSS], along[ALONG];
  fill_quartic(side.u0 + at * side.du - static_cast<double>(piece.cell_u), across);
  fill_cubic(side.v0 + at * side.dv - static_cast<double>(piece.cell_v), along);
  for (Index k = 0; k < PLACES; ++k) {
    const Four in_row{across[0][k], across[1][k], across[2][k], across[3][k]};
    const Four shares = share[k] * Four{along[0][k], along[1][k], along[2][k], along[3][k]};
    for (Index j = 0; j < ALONG; ++j) patch.first[j] += shares[j] * in_row;
    patch.last += shares * across[4][k];
  }
}

// Adds a piece of a side whose point spread is the pixel's box alone.
CMP_PART_OF_LOOP void add_sharp_piece(View<float, 3> differences, const CoverageTask& task, Index polygon,
                                      const Side& side, const Piece& piece, Index row, Index column) {
  const double step = piece.to - piece.from;
  const double at = piece.from + task.quadrature(0, 0) * step, share = task.quadrature(1, 0) * step * side.dv;
  const double u = side.u0 + at * side.du - static_cast<double>(piece.cell_u);
  for (Index plane = 0; plane < differences.size(0); ++plane) {
    const double value = task.values(polygon, plane);
    if (value == 0.0) continue;
    add_sample(differences[plane], value * (share * (1.0 - u)), row, column);
    add_sample(differences[plane], value * (share * u), row, column + 1);
  }
}

// Adds one side's differences along the rows to the band that starts at sample row `top`.
CMP_PART_OF_LOOP void add_side(View<float, 3> differences, const CoverageTask& task, Index s, Index top) {
  const Index rows = differences.size(1), columns = differences.size(2);
  const Index degree = task.spread.degree, half = degree / 2, polygon = task.owner[s];
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
    const Piece piece{t, end, static_cast<Index>(std::floor(u0 + 0.5 * (t + end) * side.du)),
                      static_cast<Index>(std::floor(v0 + 0.5 * (t + end) * side.dv))};
    t = end;
    const Index row = piece.cell_v - half - top, column = piece.cell_u - half;
    if (row + degree < 0 || row >= rows || column >= columns) continue;
    if (degree == 0) {
      add_sharp_piece(differences, task, polygon, side, piece, row, column);
      continue;
    }
    Patch patch;
    fill_patch(side, piece, task.quadrature, patch);
    for (Index plane = 0; plane < differences.size(0); ++plane) {
      const double value = task.values(polygon, plane);
      if (value != 0.0) add_patch(differences[plane], patch, value, row, column);
    }
  }
}

// Adds all sides' differences along the rows to the band that starts at sample row `top`.
void add_sides(View<float, 3> differences, const CoverageTask& task, Index top) {
  for (Index s = 0; s < task.segments.size(); ++s) add_side(differences, task, s, top);
}

// Sixteen numbers, as many as the widest registers of a processor hold.
using Lanes = float __attribute__((vector_size(64)));
constexpr Index LANES = 16, GROUPS = 4;

// Lines of samples with a weight each, of a point spread.
struct WeightedLines {
  View<const float, 1> weights;
  const float* first;
  const std::vector<Index>& offsets;  // of each line from the first

  const float* line(Index k) const { return first + offsets[k]; }
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
  const Index taps = spread.weights.size();
  Array<float, 3> image({planes, count, width});
  Array<float, 2> lines({ROWS, columns}, 0.0F);
  Array<float, 3> phases({ROWS, oversampling, columns / oversampling + 1}, 0.0F);
  std::vector<Index> below(taps), beside(taps);
  for (Index k = 0; k < taps; ++k) {
    below[k] = k * columns;
    beside[k] = k % oversampling * phases.size(2) + k / oversampling;
  }
  for (Index plane = 0; plane < planes; ++plane) {
    for (Index y = 0; y < count; y += ROWS) {
      const Index rows = std::min(ROWS, count - y);
      for (Index row = 0; row < rows; ++row) {
        const float* const top = differences[plane][oversampling * (y + row)].data();
        run_loop<fill_weighted_sum>(WeightedLines{spread.weights, top, below}, lines[row]);
      }
      fill_phases(lines, phases);
      for (Index row = 0; row < rows; ++row) {
        const WeightedLines shifted{spread.weights, phases[row].data(), beside};
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
  run_loop<add_sides>(View<float, 3>(differences), task, task.spread.oversampling * first);
  return apply_point_spread(differences, task.spread, count, task.width);
}

}  // namespace

void add_coverage(nb::module_ module) { bind<&draw_band>(module, "draw_band", {"task", "first", "count"}); }

}  // namespace cmp
