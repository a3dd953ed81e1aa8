#include "localmap/regularised_maps.hpp"

#include <cmath>

#include "numeric/batched_systems.hpp"

namespace cmp::localmap {

namespace {

using numeric::LaneRow;
using numeric::LANES;
using numeric::packed_index;

constexpr Index TERMS = 5, FIRST_CURVATURE = 2;  // x, y, xx / 2, xy, yy / 2

// One neighbour of every marker: its vector in the layout and in the image, and 1 if it is known.
struct Neighbour {
  LaneRow x, y, u, v, known;

  // Writes the neighbour n of marker m, at `vector` (2,) in the layout, into a lane; returns whether it is
  // known.
  bool fill(View<const double, 2> xy, Index m, Index n, View<const double, 1> vector, Index lane) {
    const bool is_known = n >= 0 && std::isfinite(xy(n, 0));
    x[lane] = is_known ? vector[0] : 1.0;
    y[lane] = is_known ? vector[1] : 1.0;
    u[lane] = is_known ? xy(n, 0) - xy(m, 0) : 0.0;
    v[lane] = is_known ? xy(n, 1) - xy(m, 1) : 0.0;
    known[lane] = is_known ? 1.0 : 0.0;
    return is_known;
  }
};

// The maps of up to LANES markers, one in each lane.
class Maps {
 public:
  void add(const Neighbour& neighbour) {
    std::array<LaneRow, TERMS> terms, weighted;
    for (Index lane = 0; lane < LANES; ++lane) {
      const double x = neighbour.x[lane], y = neighbour.y[lane], square = x * x + y * y;
      terms[0][lane] = x;
      terms[1][lane] = y;
      terms[2][lane] = 0.5 * x * x;
      terms[3][lane] = x * y;
      terms[4][lane] = 0.5 * y * y;
      const double weight = neighbour.known[lane] / (square * square);
      for (Index i = 0; i < TERMS; ++i) weighted[i][lane] = weight * terms[i][lane];
    }
    for (Index i = 0; i < TERMS; ++i) {
      for (Index j = 0; j <= i; ++j) numeric::add_product(normal_[packed_index(i, j)], weighted[i], terms[j]);
      numeric::add_product(side_x_[i], weighted[i], neighbour.u);
      numeric::add_product(side_y_[i], weighted[i], neighbour.v);
    }
  }

  // Regularises the curvature of a lane, by its number of known neighbours.
  void regularise(Index lane, Index known, const RegularisedMapLimits& limits) {
    const double xx = normal_[0][lane], xy = normal_[1][lane], yy = normal_[2][lane];
    const bool is_determined =
        known >= limits.min_neighbours && xx * yy - xy * xy >= limits.min_sine2 * xx * yy;
    determined_[lane] = is_determined ? 1.0 : 0.0;
    double ridge = limits.linear_ridge;
    if (known >= limits.min_curved_neighbours)
      ridge = known >= limits.min_firm_neighbours ? limits.firm_ridge : limits.weak_ridge;
    for (Index i = FIRST_CURVATURE; i < TERMS; ++i) normal_[packed_index(i, i)][lane] += ridge;
  }

  void solve() {
    numeric::update_to_cholesky_factors<TERMS>(normal_.data(), 0.0, determined_);
    numeric::update_to_solutions<TERMS>(normal_.data(), side_x_.data());
    numeric::update_to_solutions<TERMS>(normal_.data(), side_y_.data());
  }

  // Writes the derivatives (2, 5) of a lane where the neighbours determine them.
  void fill_derivatives(Index lane, View<double, 2> out) const {
    if (!(determined_[lane] > 0.0)) return;
    for (Index i = 0; i < TERMS; ++i) {
      out(0, i) = side_x_[i][lane];
      out(1, i) = side_y_[i][lane];
    }
  }

 private:
  std::array<LaneRow, TERMS*(TERMS + 1) / 2> normal_{};
  std::array<LaneRow, TERMS> side_x_{}, side_y_{};
  LaneRow determined_{};
};

}  // namespace

void fill_quadratic_derivatives(View<const double, 2> xy, View<const std::int64_t, 1> markers,
                                View<const std::int32_t, 2> ring_markers, View<const double, 3> ring_vectors,
                                View<double, 3> out, const RegularisedMapLimits& limits) {
  Neighbour neighbour{};
  for (Index start = 0; start < markers.size(); start += LANES) {
    const auto batch = markers.slice(start, std::min(start + LANES, markers.size()));
    Maps maps;
    std::array<Index, LANES> known{};
    for (Index k = 0; k < ring_markers.size(1); ++k) {
      for (Index lane = 0; lane < batch.size(); ++lane) {
        const Index m = batch[lane];
        known[lane] += neighbour.fill(xy, m, ring_markers(m, k), ring_vectors[m][k], lane);
      }
      maps.add(neighbour);
    }
    for (Index lane = 0; lane < batch.size(); ++lane) maps.regularise(lane, known[lane], limits);
    maps.solve();
    for (Index lane = 0; lane < batch.size(); ++lane) maps.fill_derivatives(lane, out[batch[lane]]);
  }
}

}  // namespace cmp::localmap
