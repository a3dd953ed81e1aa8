#include "localmap/ring_maps.hpp"

#include <cmath>

namespace cmp::localmap {

using numeric::LaneRow;
using numeric::LANES;
using numeric::packed_index;

Index RingMaps::fill_neighbours(View<const double, 2> xy, View<const double, 1> noise, Index m, Index lane,
                                View<const double, 2> marker_mm, View<const std::int32_t, 2> table) {
  double scale = 0.0;
  Index n = 0;
  for (Index k = 0; k < table.size(1); ++k) {
    const std::int32_t j = table(m, k);
    NeighbourRows& to = neighbours_[k];
    const bool is_known = j >= 0 && !std::isnan(xy(j, 0));
    const double x = is_known ? marker_mm(j, 0) - marker_mm(m, 0) : 0.0;
    const double y = is_known ? marker_mm(j, 1) - marker_mm(m, 1) : 0.0;
    to.known[lane] = is_known ? 1.0 : 0.0;
    to.x[lane] = x;
    to.y[lane] = y;
    to.u[lane] = is_known ? xy(j, 0) : 0.0;
    to.v[lane] = is_known ? xy(j, 1) : 0.0;
    to.noise[lane] = is_known ? noise[j] : 0.0;
    if (!is_known) continue;
    scale += std::hypot(x, y);
    ++n;
  }
  scale_[lane] = n > 0 ? scale / static_cast<double>(n) : 1.0;
  return n;
}

RingMaps::Terms RingMaps::terms_of(const NeighbourRows& neighbour) const {
  Terms terms;
  for (Index lane = 0; lane < LANES; ++lane) {
    const double scale = scale_[lane], is_quadratic = is_quadratic_[lane];
    const double x = neighbour.x[lane] / scale, y = neighbour.y[lane] / scale;
    terms[0][lane] = neighbour.known[lane];
    terms[1][lane] = x;
    terms[2][lane] = y;
    terms[3][lane] = x * x * is_quadratic;
    terms[4][lane] = x * y * is_quadratic;
    terms[5][lane] = y * y * is_quadratic;
  }
  return terms;
}

void RingMaps::add_to_normal_equations(const NeighbourRows& neighbour) {
  const Terms terms = terms_of(neighbour);
  for (Index a = 0; a < TERMS; ++a) {
    for (Index b = 0; b <= a; ++b) numeric::add_product(normal_[packed_index(a, b)], terms[a], terms[b]);
    numeric::add_product(sides_[FOR_X][a], terms[a], neighbour.u);
    numeric::add_product(sides_[FOR_Y][a], terms[a], neighbour.v);
  }
}

void RingMaps::add_squared_misfit(const NeighbourRows& neighbour) {
  const Terms terms = terms_of(neighbour);
  LaneRow squares = squared_misfit_;
  for (Index lane = 0; lane < LANES; ++lane) {
    double u = neighbour.u[lane], v = neighbour.v[lane];
    for (Index a = 0; a < TERMS; ++a) {
      u -= sides_[FOR_X][a][lane] * terms[a][lane];
      v -= sides_[FOR_Y][a][lane] * terms[a][lane];
    }
    squares[lane] += u * u + v * v;
  }
  squared_misfit_ = squares;
}

// Independent errors of the neighbours move the place by their sum, each times its neighbour's weight.
void RingMaps::add_noise(const NeighbourRows& neighbour) {
  const Terms terms = terms_of(neighbour);
  for (Index lane = 0; lane < LANES; ++lane) {
    double weight = 0.0;
    for (Index a = 0; a < TERMS; ++a) weight += sides_[FOR_LEVERAGE][a][lane] * terms[a][lane];
    noise_[lane] += weight * weight * neighbour.noise[lane];
    summed_noise_[lane] += neighbour.noise[lane];
  }
}

void RingMaps::solve(double min_pivot) {
  normal_ = {};
  sides_ = {};
  for (LaneRow* sum : {&squared_misfit_, &noise_, &summed_noise_}) sum->fill(0.0);
  determined_.fill(1.0);
  sides_[FOR_LEVERAGE][0].fill(1.0);
  for (const NeighbourRows& neighbour : neighbours_) add_to_normal_equations(neighbour);
  for (Index a = layout::LINEAR_TERMS; a < TERMS; ++a) {
    LaneRow diagonal = normal_[packed_index(a, a)];
    for (Index lane = 0; lane < LANES; ++lane) diagonal[lane] += 1.0 - is_quadratic_[lane];
    normal_[packed_index(a, a)] = diagonal;
  }
  numeric::update_to_cholesky_factors<TERMS>(normal_.data(), min_pivot, determined_);
  for (Terms& side : sides_) numeric::update_to_solutions<TERMS>(normal_.data(), side.data());
  for (const NeighbourRows& neighbour : neighbours_) {
    add_squared_misfit(neighbour);
    add_noise(neighbour);
  }
}

}  // namespace cmp::localmap
