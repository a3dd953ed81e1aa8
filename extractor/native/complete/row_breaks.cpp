#include "complete/row_breaks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "numeric/median.hpp"

namespace cmp::complete {

namespace {

constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

using Vector = std::array<double, 2>;

// Four markers in a row: the edge in the middle, its middle and vector, and the jump there, px.
struct Gridline {
  Index edge;
  Vector middle, rise, jump;
};

using Values = std::span<double>;

double median(Values values) {
  return numeric::median_of_many(View<double, 1>(values.data(), {static_cast<Index>(values.size())}));
}

double length(double x, double y) { return std::sqrt(x * x + y * y); }

// The gridlines of four measured markers, and the lengths of all measured edges; a
// jump is a third of the third difference.
std::vector<Gridline> gridlines_of(View<const double, 2> xy, const layout::Topology& topology,
                                   const JumpLimits& limits, std::vector<double>& lengths) {
  const auto is_measured = [&](Index m) { return m >= 0 && std::isfinite(xy(m, 0)); };
  std::vector<Gridline> found;
  double uu = 0, uv = 0, vv = 0;
  Vector by_u{}, by_v{};
  for (Index e = 0; e < topology.edges.size(); ++e) {
    const Index a = topology.edges(e, 0), b = topology.edges(e, 1);
    if (!is_measured(a) || !is_measured(b)) continue;
    Gridline line{e, {}, {}, {}};
    for (int k = 0; k < 2; ++k) line.rise[k] = xy(b, k) - xy(a, k);
    lengths.push_back(length(line.rise[0], line.rise[1]));
    const Index before = topology.next_markers(e, 0), after = topology.next_markers(e, 1);
    const double own = length(topology.third_differences(e, 0), topology.third_differences(e, 1));
    if (own >= 3 * limits.most_of_layout || !is_measured(before) || !is_measured(after)) continue;
    const double u = topology.edge_vectors(e, 0), v = topology.edge_vectors(e, 1);
    uu += u * u, uv += u * v, vv += v * v;
    for (int k = 0; k < 2; ++k) {
      line.middle[k] = (xy(a, k) + xy(b, k)) / 2;
      line.jump[k] = line.rise[k] - (xy(after, k) - xy(before, k)) / 3;
      by_u[k] += u * line.rise[k], by_v[k] += v * line.rise[k];
    }
    found.push_back(line);
  }
  // Round and elliptical layouts have third differences themselves. These are mapped to the image, and taken
  // off.
  const double determinant = uu * vv - uv * uv;
  if (determinant <= 1e-9 * uu * vv) return found;
  for (Gridline& line : found) {
    const double u = topology.third_differences(line.edge, 0), v = topology.third_differences(line.edge, 1);
    for (int k = 0; k < 2; ++k)
      line.jump[k] -=
          (u * (vv * by_u[k] - uv * by_v[k]) + v * (uu * by_v[k] - uv * by_u[k])) / (3 * determinant);
  }
  return found;
}

// The length of the median jump of each strip along an axis, the later row or column less the earlier one,
// beyond `disagreement` times the squared distance of its gridlines' jumps from that.
Array<double, 1> jumps_along(const std::vector<Gridline>& lines, int axis, double edge, double disagreement,
                             const JumpLimits& limits) {
  struct Crossing {
    std::size_t strip;
    Vector jump;
  };
  std::vector<Crossing> crossings;
  std::vector<std::size_t> end;  // of each strip's crossings, sorted by strips
  for (const Gridline& line : lines) {
    const double rise = line.rise[axis];
    if (std::abs(rise) <= limits.min_rise * edge || line.middle[axis] < 0) continue;
    const auto strip = static_cast<std::size_t>(line.middle[axis] / (limits.bin * edge));
    if (strip >= end.size()) end.resize(strip + 1);
    ++end[strip];
    const auto jump = [&](int k) { return std::clamp(std::copysign(1.0, rise) * line.jump[k], -edge, edge); };
    crossings.push_back({strip, {jump(0), jump(1)}});
  }
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<std::size_t> next(end);
  std::vector<double> x(crossings.size()), y(crossings.size());
  for (const Crossing& one : crossings) {
    const std::size_t at = --next[one.strip];
    x[at] = one.jump[0], y[at] = one.jump[1];
  }
  Array<double, 1> jump({static_cast<Index>(end.size())}, NONE);
  for (std::size_t s = 0; s < end.size(); ++s) {
    const std::size_t count = end[s] - next[s];
    if (static_cast<Index>(count) < limits.min_gridlines) continue;
    std::vector<double> apart(count);
    for (std::size_t i = 0; i < count; ++i) apart[i] = x[next[s] + i];
    const double dx = median(apart);
    for (std::size_t i = 0; i < count; ++i) apart[i] = y[next[s] + i];
    const double dy = median(apart);
    double beyond = dx * dx + dy * dy;
    if (disagreement > 0.0) {
      for (std::size_t i = 0; i < count; ++i) {
        const double from_x = x[next[s] + i] - dx, from_y = y[next[s] + i] - dy;
        apart[i] = from_x * from_x + from_y * from_y;
      }
      beyond -= disagreement * median(apart);
    }
    jump[static_cast<Index>(s)] = std::sqrt(std::max(beyond, 0.0));
  }
  return jump;
}

// The largest jump and the root mean square of the known ones; NaN without any.
std::pair<double, double> largest_and_usual(View<const double, 1> jumps) {
  double largest = NONE, squares = 0.0, count = 0.0;
  for (const double jump : jumps) {
    if (std::isnan(jump)) continue;
    largest = count > 0.0 ? std::max(largest, jump) : jump;
    squares += jump * jump, count += 1.0;
  }
  return {largest, std::sqrt(squares / count)};
}

}  // namespace

StripJumps measure_jumps(View<const double, 2> xy, const layout::Topology& topology,
                         const JumpLimits& limits) {
  std::vector<double> lengths;
  const auto lines = gridlines_of(xy, topology, limits, lengths);
  if (static_cast<Index>(lengths.size()) < limits.min_gridlines)
    return {0.0, Array<double, 1>({0}), NONE, false};
  const double edge = median(lengths);
  Array<double, 1> rows = jumps_along(lines, 1, edge, limits.disagreement, limits);
  const auto [largest, usual] = largest_and_usual(rows);
  const auto [largest_column, usual_column] = largest_and_usual(jumps_along(lines, 0, edge, 0.0, limits));
  const bool is_one = largest > std::max(limits.min_jump * edge, limits.ratio * largest_column);
  const bool are_all = usual > std::max(limits.min_usual_jump * edge, limits.usual_ratio * usual_column);
  return {edge, std::move(rows), largest, !std::isnan(largest_column) && (is_one || are_all)};
}

}  // namespace cmp::complete
