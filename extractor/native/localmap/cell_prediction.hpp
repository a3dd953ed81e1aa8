// Predicts the image places of the down-cells around numbered cells.
//
// The three cells next to a place predict it best. Cells farther away are used only for places that the
// nearer cells leave open and that are possible origins of the pattern.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::localmap {

inline constexpr Index RINGS = 4;     // the length of white_reaches
inline constexpr Index MAX_STEP = 6;  // largest axial step to a down-cell, and one more

// Limits of the prediction; explained in extractor/localmap/cell_prediction.py.
struct CellPredictionLimits {
  double max_outside_share, min_determinant;
  std::array<double, RINGS> white_reaches;

  template <class F>
  static CellPredictionLimits read(const F& f) {
    return {f["max_outside_share"], f["min_determinant"], f["white_reaches"]};
  }
};

// The axial places around a component of the cell mesh.
struct AxialGrid {
  Index low_q, low_r;                  // the least axial coordinates
  Array<std::int32_t, 2> cell_lookup;  // (Q, R) the index of the known cell at each place, -1 for none
  Array<bool, 2> excluded;             // (Q, R) the places not to be predicted
};

// The K cells that predict.
struct KnownCells {
  View<const std::int64_t, 1> cells;  // (K,) the cells of the image
  View<const double, 3> basis;        // (K, 2, 2) px per axial step
  View<const double, 1> radius_px;    // (K,) over which the cell's color is sampled
  View<const double, 1> level;        // (K,) the sum of its channels, NaN outside the image
};

// P predicted down-cells.
struct PredictedPlaces {
  Array<std::int32_t, 2> axial;  // (P, 2) the axial places
  Array<double, 2> means;        // (P, 4) means over the predicting cells: x and y, px, radius_px, level
  Array<std::int64_t, 1> support_count;  // (P,) the number of predicting cells
};

// The local bases of the lattice, by least squares over the six neighbours of each cell.
//
// center (N, 2) px; axial (N, 2), UNKNOWN_AXIAL for unknown. The cells (K,) with enough neighbours, and (K,
// 2, 2) px per axial step at each.
std::tuple<Array<std::int64_t, 1>, Array<double, 3>> lattice_bases(View<const double, 2> center,
                                                                   View<const std::int32_t, 2> axial,
                                                                   const CellPredictionLimits& limits);

// The grid of the known cells (K,), with all places that they can predict, each at least MAX_STEP from its
// border.
//
// axial (N, 2); level (K,): cells whose level is NaN predict nothing.
AxialGrid build_axial_grid(View<const std::int32_t, 2> axial, View<const std::int64_t, 1> known,
                           View<const double, 1> level);

// Excludes axial places (P, 2).
void update_excluded_places(AxialGrid& grid, View<const std::int32_t, 2> places);

// Excludes the places where the white cell would leave too many known cells outside the layout.
//
// The extents along q, r and q + r, the directions of the layout's sides, are compared.
void update_excluded_misfits(AxialGrid& grid, View<const std::int32_t, 2> axial,
                             View<const std::int64_t, 1> known, Index layers,
                             const CellPredictionLimits& limits);

// The down-cells that are not excluded and have a known cell within one ring.
//
// center (N, 2) px; grid, of the known cells; ring, index into white_reaches.
PredictedPlaces predicted_places(View<const double, 2> center, const KnownCells& known, const AxialGrid& grid,
                                 Index ring, const CellPredictionLimits& limits);

}  // namespace cmp::localmap
