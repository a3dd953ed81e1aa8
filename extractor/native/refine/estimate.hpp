// The values that refinement passes from step to step: the parts that compiled functions take.
#pragma once

#include "base/array.hpp"
#include "refine/measure/marker_scatter.hpp"

namespace cmp::refine {

// The estimated places of the pattern.
struct PatternState {
  View<const double, 2> xy;         // (M, 2) px
  View<const bool, 1> hidden;       // (M,) markers that the image shows little or not at all
  View<const double, 3> maps;       // (M, 2, 5), as local_maps gives them
  View<const double, 1> roughness;  // (M,) px^2
  View<const double, 2> bend;       // (E, 2) px
  View<const double, 1> weight;     // (E,) 0 to 1, of the gridlines in the last step
  double sigma;                     // the blur, px
  double noise;                     // gray levels, one channel
  double dot_gain;                  // px
  MarkerScatter scatter;

  template <class F>
  static PatternState read(const F& f) {
    return {f["xy"],     f["hidden"], f["maps"],  f["roughness"], f["bend"],
            f["weight"], f["sigma"],  f["noise"], f["dot_gain"],  f["scatter"]};
  }
};

// The change of color across the gridlines.
struct EdgeContrasts {
  View<const double, 2> sides;      // (E, 6) light on both sides, as GridlineSides gives it
  View<const double, 2> contrasts;  // (E, 3) gray levels, differences of the values on both sides
  View<const double, 2> clearance;  // (E, 4), as gridline_clearance gives it

  template <class F>
  static EdgeContrasts read(const F& f) {
    return {f["sides"], f["contrasts"], f["clearance"]};
  }
};

// Markers before refinement.
struct StartPlaces {
  View<const double, 2> xy_px;  // (M, 2) px at the scale of the step, NaN where there is none
  View<const double, 1>
      edge_px;  // (M,) the mean length of the edges at each marker, px, NaN where there is none
  View<const bool, 1> agreed;     // (M,) the triangles found at the marker meet
  View<const bool, 1> is_intact;  // (M,) these are all triangles that the pattern has there

  template <class F>
  static StartPlaces read(const F& f) {
    return {f["xy_px"], f["edge_px"], f["agreed"], f["is_intact"]};
  }
};

}  // namespace cmp::refine
