// Quadratic maps from layout to image through the markers of two rings, for many markers at once.
//
// Up to LANES markers are computed together, one in each lane. All numbers of an unknown neighbour are 0.
#pragma once

#include "layout/neighbour_tables.hpp"
#include "numeric/batched_systems.hpp"

namespace cmp::localmap {

// One neighbour of LANES markers: 1 if known; mm, mm, px, px; its variance by noise, px^2.
struct NeighbourRows {
  numeric::LaneRow known, x, y, u, v, noise;
};

// The maps of LANES markers.
class RingMaps {
 public:
  // Memory for maps through so many neighbours.
  explicit RingMaps(Index neighbours) : neighbours_({neighbours}, NeighbourRows{}) {
    scale_.fill(1.0);
    is_quadratic_.fill(1.0);
  }

  // Writes the known neighbours of marker m into a lane; returns how many are known.
  //
  // xy (M, 2) px, the markers' places, NaN unknown; noise (M,) px^2 per axis; marker_mm (M, 2) in the layout;
  // table (M, K), the neighbours of each marker, or -1.
  Index fill_neighbours(View<const double, 2> xy, View<const double, 1> noise, Index m, Index lane,
                        View<const double, 2> marker_mm, View<const std::int32_t, 2> table);
  void set_quadratic(Index lane, bool is_quadratic) { is_quadratic_[lane] = is_quadratic ? 1.0 : 0.0; }
  // Fits the maps of all lanes.
  void solve(double min_pivot);

  bool is_quadratic(Index lane) const { return is_quadratic_[lane] > 0.0; }
  bool is_determined(Index lane) const { return determined_[lane] > 0.0; }
  double x(Index lane) const { return sides_[FOR_X][0][lane]; }
  double y(Index lane) const { return sides_[FOR_Y][0][lane]; }
  double leverage(Index lane) const { return sides_[FOR_LEVERAGE][0][lane]; }
  double squared_misfit(Index lane) const { return squared_misfit_[lane]; }  // the sum, px^2
  double noise(Index lane) const { return noise_[lane]; }                    // of the place, px^2
  double summed_noise(Index lane) const { return summed_noise_[lane]; }      // of all neighbours, px^2

 private:
  static constexpr Index TERMS = layout::QUADRATIC_TERMS;
  static constexpr int FOR_X = 0, FOR_Y = 1, FOR_LEVERAGE = 2;
  using Terms = std::array<numeric::LaneRow, TERMS>;

  Terms terms_of(const NeighbourRows& neighbour) const;
  void add_to_normal_equations(const NeighbourRows& neighbour);
  void add_squared_misfit(const NeighbourRows& neighbour);
  void add_noise(const NeighbourRows& neighbour);

  Array<NeighbourRows, 1> neighbours_;
  numeric::LaneRow scale_{};         // the neighbours' mean distance in the layout, mm
  numeric::LaneRow is_quadratic_{};  // 1 for a quadratic, 0 for a linear map
  numeric::LaneRow squared_misfit_{}, noise_{}, summed_noise_{}, determined_{};
  std::array<numeric::LaneRow, TERMS*(TERMS + 1) / 2> normal_{};
  std::array<Terms, layout::RIGHT_SIDES> sides_{};  // the right sides, then the solutions
};

}  // namespace cmp::localmap
