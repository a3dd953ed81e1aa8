#include "cells/cell_mesh.hpp"

#include <cmath>
#include <vector>

#include "numeric/median.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::cells {

namespace {

// The steps of N cells to the cells nearest to the places where neighbours are expected.
class Steps {
 public:
  Steps(View<const double, 2> center, View<const double, 3> corner)
      : center_(center),
        corner_(corner),
        grid_(numeric::bucket_grid(center)),
        to_({center.size(), STEPS}),
        misfit_({center.size(), STEPS}),
        length_({center.size(), STEPS}) {}

  // Looks the neighbours up, with sides divided by the swelling; farther ones than the tolerance are none.
  void find(double swelling, double tolerance) {
    Array<std::int32_t, 1> index({1});
    Array<double, 1> square({1});
    for (Index i = 0; i < center_.size(); ++i)
      for (Index j = 0; j < STEPS; ++j) {
        const auto [a, b] = STEP_CORNERS[j];
        const double x = (corner_(i, a, 0) - corner_(i, b, 0)) / swelling;
        const double y = (corner_(i, a, 1) - corner_(i, b, 1)) / swelling;
        const double length = std::sqrt(x * x + y * y);
        numeric::fill_nearest_points(grid_, center_(i, 0) + x, center_(i, 1) + y, index, square);
        const double misfit = std::sqrt(square[0]) / length;
        to_(i, j) = misfit < tolerance && index[0] != i ? index[0] : -1;
        misfit_(i, j) = misfit;
        length_(i, j) = length;
      }
  }
  // The step by which the neighbour at step j of cell i leads back; -1 if there is none.
  int back(Index i, Index j) const {
    const std::int32_t other = to_(i, j);
    if (other < 0) return -1;
    for (int k = 0; k < STEPS; ++k)
      if (to_(other, k) == i) return k;
    return -1;
  }
  // The median of expected distances over the neighbours' true distances.
  double relative_length() const {
    std::vector<double> ratios;
    for (Index i = 0; i < center_.size(); ++i)
      for (Index j = 0; j < STEPS; ++j) {
        if (back(i, j) < 0) continue;
        const double x = center_(to_(i, j), 0) - center_(i, 0), y = center_(to_(i, j), 1) - center_(i, 1);
        ratios.push_back(length_(i, j) / std::max(std::sqrt(x * x + y * y), 1e-9));
      }
    if (ratios.empty()) return 1.0;
    return numeric::median_of_many(View<double, 1>(ratios.data(), {static_cast<Index>(ratios.size())}));
  }
  std::int32_t to(Index i, Index j) const { return to_(i, j); }
  double misfit(Index i, Index j) const { return misfit_(i, j); }

 private:
  View<const double, 2> center_;
  View<const double, 3> corner_;
  numeric::BucketGrid grid_;
  Array<std::int32_t, 2> to_;
  Array<double, 2> misfit_, length_;
};

}  // namespace

CellLinks link_cells(View<const double, 2> center, View<const double, 3> corner, const CellMeshLimits& limits) {
  const Index count = center.size();
  Array<std::int32_t, 2> neighbours({count, STEPS}, -1);
  Array<std::int8_t, 2> back({count, STEPS}, std::int8_t{-1});
  Array<double, 2> misfit({count, STEPS}, 0.0);
  double swelling = 1.0;
  if (count > 1) {
    Steps steps(center, corner);
    for (std::int64_t round = 0; round < limits.swelling_rounds; ++round) {
      steps.find(swelling, limits.first_tolerance);
      swelling *= steps.relative_length();
    }
    steps.find(swelling, limits.tolerance);
    for (Index i = 0; i < count; ++i)
      for (Index j = 0; j < STEPS; ++j) {
        const int other = steps.back(i, j);
        if (other < 0) continue;
        neighbours(i, j) = steps.to(i, j);
        back(i, j) = static_cast<std::int8_t>(other);
        misfit(i, j) = 0.5 * (steps.misfit(i, j) + steps.misfit(steps.to(i, j), other));
      }
  }
  return {std::move(neighbours), std::move(back), std::move(misfit), swelling};
}

}  // namespace cmp::cells
