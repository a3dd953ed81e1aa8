#include "localmap/cell_prediction.hpp"

#include <cmath>
#include <vector>

#include "layout/lattice.hpp"
#include "layout/lattice_tables.hpp"

namespace cmp::localmap {

namespace {

using layout::UNKNOWN_AXIAL;

constexpr int FIRST_STEP_Q = -4, END_STEP_Q = 6, FIRST_STEP_R = -5,
              END_STEP_R = 5;   // to down-cells around a cell
constexpr Index MEANS = 4;      // of a predicted place
constexpr Index FAR = 1 << 20;  // beyond any axial coordinate

// A down-cell around a cell (q, r).
struct DownCell {
  Index step_q, step_r;       // axial steps to it
  double vector_q, vector_r;  // between the centers, in axial steps
};

// The down-cells whose distance is in one ring of reaches, in edges of an equilateral lattice.
std::vector<DownCell> down_cells(Index ring, const std::array<double, RINGS>& reaches) {
  std::vector<DownCell> found;
  for (int q = FIRST_STEP_Q; q < END_STEP_Q; ++q)
    for (int r = FIRST_STEP_R; r < END_STEP_R; ++r) {
      const double u = q + -2.0 / 3.0, v = r + 1.0 / 3.0;
      const double distance = std::sqrt((u * u + v * v) + u * v);
      const auto own =
          std::count_if(reaches.begin(), reaches.end(), [&](double reach) { return reach < distance; });
      if (own == ring) found.push_back({q, r, u, v});
    }
  return found;
}

// The cells with a place, by axial place, with a border of -1.
class CellLookup {
 public:
  explicit CellLookup(View<const std::int32_t, 2> axial) {
    for (Index i = 0; i < axial.size(); ++i)
      if (axial(i, 0) != UNKNOWN_AXIAL)
        reach_ = std::max({reach_, std::abs(Index{axial(i, 0)}) + 1, std::abs(Index{axial(i, 1)}) + 1});
    memory_ = Array<std::int32_t, 2>({2 * reach_ + 1, 2 * reach_ + 1}, -1);
    table_ = memory_.view();
    for (Index i = 0; i < axial.size(); ++i)
      if (axial(i, 0) != UNKNOWN_AXIAL)
        table_(axial(i, 0) + reach_, axial(i, 1) + reach_) = static_cast<std::int32_t>(i);
  }
  std::int32_t at(Index q, Index r) const { return table_(q + reach_, r + reach_); }

 private:
  Index reach_ = 1;
  Array<std::int32_t, 2> memory_;
  View<std::int32_t, 2> table_;
};

// Sums of the places of neighbours over their axial steps.
struct BasisSums {
  double qq = 0.0, qr = 0.0, rr = 0.0, xq = 0.0, xr = 0.0, yq = 0.0, yr = 0.0;

  void add(double dq, double dr, double dx, double dy) {
    qq += dq * dq;
    qr += dq * dr;
    rr += dr * dr;
    xq += dx * dq;
    xr += dx * dr;
    yq += dy * dq;
    yr += dy * dr;
  }
  double determinant() const { return qq * rr - qr * qr; }
  void fill_basis(View<double, 2> basis) const {
    const double area = determinant();
    basis(0, 0) = (xq * rr - xr * qr) / area;
    basis(0, 1) = (xr * qq - xq * qr) / area;
    basis(1, 0) = (yq * rr - yr * qr) / area;
    basis(1, 1) = (yr * qq - yq * qr) / area;
  }
};

}  // namespace

std::tuple<Array<std::int64_t, 1>, Array<double, 3>> lattice_bases(View<const double, 2> center,
                                                                   View<const std::int32_t, 2> axial,
                                                                   const CellPredictionLimits& limits) {
  const CellLookup lookup(axial);
  Array<std::int64_t, 1> known({center.size()});
  Array<double, 3> basis({center.size(), 2, 2});
  const auto known_cells = known.view();
  const auto bases = basis.view();
  Index found = 0;
  for (Index i = 0; i < center.size(); ++i) {
    const Index q = axial(i, 0), r = axial(i, 1);
    if (q == UNKNOWN_AXIAL) continue;
    BasisSums sums;
    for (const auto& step : layout::NEIGHBOUR_STEPS) {
      const std::int32_t j = lookup.at(q + step[0], r + step[1]);
      if (j < 0) continue;
      sums.add(static_cast<double>(step[0]), static_cast<double>(step[1]), center(j, 0) - center(i, 0),
               center(j, 1) - center(i, 1));
    }
    if (!(sums.determinant() > limits.min_determinant)) continue;
    sums.fill_basis(bases[found]);
    known_cells[found++] = i;
  }
  return {known.first(found), basis.first(found)};
}

AxialGrid build_axial_grid(View<const std::int32_t, 2> axial, View<const std::int64_t, 1> known,
                           View<const double, 1> level) {
  Index low_q = FAR, low_r = FAR, high_q = -FAR, high_r = -FAR;
  for (const std::int64_t i : known) {
    const Index q = axial(i, 0), r = axial(i, 1);
    low_q = std::min(low_q, q);
    high_q = std::max(high_q, q);
    low_r = std::min(low_r, r);
    high_r = std::max(high_r, r);
  }
  low_q -= 2 * MAX_STEP;
  low_r -= 2 * MAX_STEP;
  const std::array<Index, 2> shape{high_q - low_q + 2 * MAX_STEP + 1, high_r - low_r + 2 * MAX_STEP + 1};
  AxialGrid grid{low_q, low_r, Array<std::int32_t, 2>(shape, -1), Array<bool, 2>(shape, false)};
  for (Index n = 0; n < known.size(); ++n)
    if (!std::isnan(level[n]))
      grid.cell_lookup(axial(known[n], 0) - low_q, axial(known[n], 1) - low_r) = static_cast<std::int32_t>(n);
  return grid;
}

void update_excluded_places(AxialGrid& grid, View<const std::int32_t, 2> places) {
  for (Index n = 0; n < places.size(); ++n)
    grid.excluded(places(n, 0) - grid.low_q, places(n, 1) - grid.low_r) = true;
}

void update_excluded_misfits(AxialGrid& grid, View<const std::int32_t, 2> axial,
                             View<const std::int64_t, 1> known, Index layers,
                             const CellPredictionLimits& limits) {
  const Index rows = grid.cell_lookup.size(0), columns = grid.cell_lookup.size(1), values = rows + columns;
  Array<bool, 2> fits({3, values}, false);
  Array<Index, 1> below({values + 1});  // known cells of a smaller coordinate
  const double allowed = limits.max_outside_share * static_cast<double>(known.size());
  const Index reach = layers + 1;  // by the rotation, a side may be one step nearer
  for (int axis = 0; axis < 3; ++axis) {
    below.fill(0);
    for (const std::int64_t i : known) {
      const Index q = axial(i, 0) - grid.low_q, r = axial(i, 1) - grid.low_r;
      ++below[(axis == 0 ? q : axis == 1 ? r : q + r) + 1];
    }
    for (Index value = 0; value < values; ++value) below[value + 1] += below[value];
    for (Index value = 0; value < values; ++value) {
      const Index low = std::max<Index>(value - reach, 0), high = std::min(value + reach + 1, values);
      fits(axis, value) = static_cast<double>(below[low] + known.size() - below[high]) <= allowed;
    }
  }
  const auto excluded = grid.excluded.view();
  const auto by_q = fits[0], by_r = fits[1], by_sum = fits[2];
  for (Index q = 0; q < rows; ++q)
    for (Index r = 0; r < columns; ++r)
      excluded(q, r) = excluded(q, r) || !(by_q[q] && by_r[r] && by_sum[q + r]);
}

PredictedPlaces predicted_places(View<const double, 2> center, const KnownCells& known, const AxialGrid& grid,
                                 Index ring, const CellPredictionLimits& limits) {
  const View<const std::int32_t, 2> lookup = grid.cell_lookup;
  const View<const bool, 2> excluded = grid.excluded;
  const auto steps = down_cells(ring, limits.white_reaches);
  const Index rows = lookup.size(0), columns = lookup.size(1);
  const auto all = excluded.flat();
  const Index count = std::count(all.begin(), all.end(), false);
  Array<std::int32_t, 2> places({count, 2});
  Array<double, 2> means({count, MEANS});
  Array<std::int64_t, 1> support({count});
  Index found = 0;
  for (Index q = MAX_STEP; q < rows - MAX_STEP; ++q)
    for (Index r = MAX_STEP; r < columns - MAX_STEP; ++r) {
      if (excluded(q, r)) continue;
      double x = 0.0, y = 0.0, radius = 0.0, level = 0.0;
      std::int64_t cells = 0;
      for (const DownCell& step : steps) {
        const std::int32_t n = lookup(q - step.step_q, r - step.step_r);
        if (n < 0) continue;
        const Index i = known.cells[n];
        x += center(i, 0) + known.basis(n, 0, 0) * step.vector_q + known.basis(n, 0, 1) * step.vector_r;
        y += center(i, 1) + known.basis(n, 1, 0) * step.vector_q + known.basis(n, 1, 1) * step.vector_r;
        radius += known.radius_px[n];
        level += known.level[n];
        ++cells;
      }
      if (cells == 0) continue;
      const auto share = static_cast<double>(cells);
      places(found, 0) = static_cast<std::int32_t>(q + grid.low_q);
      places(found, 1) = static_cast<std::int32_t>(r + grid.low_r);
      const std::array<double, MEANS> mean{x / share, y / share, radius / share, level / share};
      std::copy(mean.begin(), mean.end(), means[found].begin());
      support[found++] = cells;
    }
  return {places.first(found), means.first(found), support.first(found)};
}

}  // namespace cmp::localmap
