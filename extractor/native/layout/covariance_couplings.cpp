#include "layout/covariance_couplings.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cmp::layout {

namespace {

constexpr Index WAYS = 2;                 // by tangents, by second derivatives
constexpr Index MEMBERS = 7, SPOKES = 6;  // a marker and its neighbours, and the gridlines at each
constexpr Index SIZE = 2 * MEMBERS;

using System = std::array<std::array<double, SIZE>, SIZE>;
using Rows = std::array<std::array<double, SIZE>, 2>;
using Square = std::array<std::array<double, 2>, 2>;

// A gridline at a member of a neighbourhood.
struct Line {
  Index member, edge, side;  // 0: the member is its start
  Index other;               // the member at its other end, -1 for none
  double strength;
  std::array<double, 2> normal;
  std::array<std::array<double, MEMBERS>, WAYS> bent;  // its bending by the members, as a pull on this end
};

// A marker with its neighbours.
struct Neighbourhood {
  Index marker, count = 0;
  std::array<Line, MEMBERS * SPOKES> lines;
  std::array<Square, WAYS> sandwich;
};

// Adds up how the pulls of all gridlines change with the members; weight(line, n): of member n.
template <class Weight>
System system_of(const Neighbourhood& at, double least_sum, Weight weight) {
  System out{};
  for (Index k = 0; k < SIZE; ++k) out[k][k] = least_sum;
  for (Index l = 0; l < at.count; ++l) {
    const Line& line = at.lines[l];
    for (Index n = 0; n < MEMBERS; ++n) {
      const double pull = line.strength * weight(line, n);
      if (pull == 0.0) continue;
      for (Index i = 0; i < 2; ++i)
        for (Index j = 0; j < 2; ++j)
          out[2 * line.member + i][2 * n + j] += pull * line.normal[i] * line.normal[j];
    }
  }
  return out;
}

// The first two rows of the inverse, by elimination with pivots in the transposed matrix.
Rows first_rows_of_inverse(const System& system) {
  std::array<std::array<double, SIZE + 2>, SIZE> a{};
  for (Index i = 0; i < SIZE; ++i) {
    for (Index j = 0; j < SIZE; ++j) a[i][j] = system[j][i];
    if (i < 2) a[i][SIZE + i] = 1.0;
  }
  for (Index k = 0; k < SIZE; ++k) {
    Index pivot = k;
    for (Index i = k + 1; i < SIZE; ++i)
      if (std::abs(a[i][k]) > std::abs(a[pivot][k])) pivot = i;
    std::swap(a[k], a[pivot]);
    for (Index i = k + 1; i < SIZE; ++i) {
      const double factor = a[i][k] / a[k][k];
      if (factor == 0.0) continue;
      for (Index j = k; j < SIZE + 2; ++j) a[i][j] -= factor * a[k][j];
    }
  }
  Rows rows;
  for (Index r = 0; r < 2; ++r)
    for (Index i = SIZE - 1; i >= 0; --i) {
      double value = a[i][SIZE + r];
      for (Index j = i + 1; j < SIZE; ++j) value -= a[i][j] * rows[r][j];
      rows[r][i] = value / a[i][i];
    }
  return rows;
}

double straight(const Line& line, Index n) {
  return (n == line.member ? 1.0 / 3.0 : 0.0) + (n == line.other ? 1.0 / 6.0 : 0.0);
}

Line line_of(Index edge, Index member, const std::array<Index, MEMBERS>& members, const SlopeWeights& slopes,
             const LayoutGridlines& gridlines, const CouplingLimits& limits) {
  Line line{member, edge, gridlines.edges(edge, 1) == members[member] ? 1 : 0, -1, 0.0, {}, {}};
  const double x = gridlines.vectors(edge, 0), y = gridlines.vectors(edge, 1),
               length = std::sqrt(x * x + y * y);
  line.strength = gridlines.is_seen[edge] ? length : 0.0;
  line.normal = {-y / length, x / length};
  const auto place_of = [&](Index id) -> Index {
    const auto found = std::find(members.begin(), members.end(), id);
    return found == members.end() ? -1 : found - members.begin();
  };
  line.other = place_of(gridlines.edges(edge, 1 - line.side));
  const double by_leave = limits.bent_sums[0][line.side], by_arrive = limits.bent_sums[1][line.side];
  for (Index k = 0; k < slopes.ids.size(1); ++k) {
    const Index n = place_of(slopes.ids(edge, k));
    if (n < 0) continue;
    for (Index way = 0; way < WAYS; ++way)
      line.bent[way][n] += by_leave * slopes.leave(way, edge, k) + by_arrive * slopes.arrive(way, edge, k);
  }
  return line;
}

// The covariances of a marker if all its gridlines are equally strong.
Square sandwich_of(const Neighbourhood& at, Index way, double least_sum) {
  const System spread = system_of(at, least_sum, straight);
  const Rows response = first_rows_of_inverse(system_of(
      at, least_sum, [&](const Line& line, Index n) { return straight(line, n) + line.bent[way][n]; }));
  Square out{};
  for (Index i = 0; i < 2; ++i)
    for (Index j = 0; j < 2; ++j)
      for (Index k = 0; k < SIZE; ++k)
        for (Index l = 0; l < SIZE; ++l) out[i][j] += response[i][k] * spread[k][l] * response[j][l];
  return out;
}

Neighbourhood neighbourhood_of(Index marker, const SlopeWeights& slopes, const LayoutGridlines& gridlines,
                               const CouplingLimits& limits) {
  Neighbourhood out;
  out.marker = marker;
  std::array<Index, MEMBERS> members;
  members.fill(-1);
  members[0] = marker;
  for (Index k = 0; k < SPOKES; ++k) {
    const Index edge = gridlines.spokes(marker, k);
    if (edge >= 0) members[1 + k] = gridlines.edges(edge, 0) + gridlines.edges(edge, 1) - marker;
  }
  for (Index m = 0; m < MEMBERS; ++m)
    for (Index k = 0; k < SPOKES && members[m] >= 0; ++k)
      if (gridlines.spokes(members[m], k) >= 0)
        out.lines[out.count++] =
            line_of(gridlines.spokes(members[m], k), m, members, slopes, gridlines, limits);
  for (Index way = 0; way < WAYS; ++way) out.sandwich[way] = sandwich_of(out, way, limits.least_sum);
  return out;
}

// The marker's block of the inverse of the information; couplings (E, 6).
Square inverse_of(const Neighbourhood& at, View<const double, 2> couplings, Index way, double least_sum) {
  const Rows rows = first_rows_of_inverse(system_of(at, least_sum, [&](const Line& line, Index n) {
    const auto own = couplings[line.edge].from(3 * way);
    return (n == line.member ? own[line.side] / 3.0 : 0.0) + (n == line.other ? own[2] / 6.0 : 0.0);
  }));
  return {{{rows[0][0], rows[0][1]}, {rows[1][0], rows[1][1]}}};
}

double variance_along(const Square& covariance, const std::array<double, 2>& normal) {
  double sum = 0.0;
  for (Index i = 0; i < 2; ++i)
    for (Index j = 0; j < 2; ++j) sum += normal[i] * covariance[i][j] * normal[j];
  return sum;
}

// The mean of the sandwich over the inverse of the information, inside the pattern.
double usual_ratio(const Array<Neighbourhood, 1>& inside, View<const double, 2> couplings, Index way,
                   double least_sum) {
  double sum = 0.0;
  for (Index k = 0; k < inside.size(); ++k) {
    const Square& of = inside[k].sandwich[way];
    const Square by = inverse_of(inside[k], couplings, way, least_sum);
    const double determinant = by[0][0] * by[1][1] - by[0][1] * by[1][0];
    sum +=
        (of[0][0] * by[1][1] - of[0][1] * by[1][0] - of[1][0] * by[0][1] + of[1][1] * by[0][0]) / determinant;
  }
  return sum / (2.0 * static_cast<double>(inside.size()));
}

// One round: the couplings of the markers' own ends, times the inverse over what it should be.
void scale_own_ends(const Array<Neighbourhood, 1>& outside, double usual, Index way, double least_sum,
                    View<double, 2> couplings) {
  Array<std::array<double, SPOKES>, 1> factors({outside.size()});
  for (Index r = 0; r < outside.size(); ++r) {
    const Neighbourhood& at = outside[r];
    const Square inverse = inverse_of(at, couplings, way, least_sum);
    for (Index l = 0; l < at.count && at.lines[l].member == 0; ++l)
      factors[r][l] = variance_along(inverse, at.lines[l].normal) * usual /
                      variance_along(at.sandwich[way], at.lines[l].normal);
  }
  for (Index r = 0; r < outside.size(); ++r) {
    const Neighbourhood& at = outside[r];
    for (Index l = 0; l < at.count && at.lines[l].member == 0; ++l)
      couplings(at.lines[l].edge, 3 * way + at.lines[l].side) *= factors[r][l];
  }
}

}  // namespace

Array<double, 2> covariance_couplings(View<const double, 2> couplings, const SlopeWeights& slopes,
                                      const LayoutGridlines& gridlines, const CouplingLimits& limits) {
  Array<double, 2> out({couplings.size(), couplings.size(1)});
  for (Index e = 0; e < couplings.size(); ++e)
    std::copy_n(couplings[e].begin(), couplings.size(1), out[e].begin());
  const Index markers = gridlines.is_inner.size();
  const Index inner = std::count(gridlines.is_inner.begin(), gridlines.is_inner.end(), true);
  if (inner == 0) return out;
  Array<Neighbourhood, 1> inside({std::min<Index>(inner, limits.inner_markers)}), outside({markers - inner});
  for (Index m = 0, i = 0, o = 0; m < markers; ++m) {
    if (!gridlines.is_inner[m])
      outside[o++] = neighbourhood_of(m, slopes, gridlines, limits);
    else if (i < inside.size())
      inside[i++] = neighbourhood_of(m, slopes, gridlines, limits);
  }
  for (Index way = 0; way < WAYS; ++way) {
    const double usual = usual_ratio(inside, out, way, limits.least_sum);
    for (std::int64_t round = 0; round < limits.rounds; ++round)
      scale_own_ends(outside, usual, way, limits.least_sum, out);
  }
  return out;
}

}  // namespace cmp::layout
