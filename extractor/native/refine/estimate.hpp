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
  View<const double, 2> ink_shift;  // (3, 2) of the inks in the layout, in units of the mean edge
  MarkerScatter scatter;
};

// Markers before refinement.
struct StartPlaces {
  View<const double, 2> xy_px;  // (M, 2) px at the scale of the step, NaN where there is none
  View<const double, 1>
      edge_px;  // (M,) the mean length of the edges at each marker, px, NaN where there is none
  View<const bool, 1> agreed;     // (M,) the triangles found at the marker meet
  View<const bool, 1> is_intact;  // (M,) these are all triangles that the pattern has there

  CMP_RECORD("extractor.numbering.marker_places.InitialMarkers", xy_px, edge_px, agreed, is_intact)
};

}  // namespace cmp::refine
