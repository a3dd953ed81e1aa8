// Uncertain markers, as under dirt: the measurement is combined with the prediction by other markers.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::complete {

// Limits of uncertain markers.
struct UncertainLimits {
  // in edges, of a marker that others may predict better: at best to 0.012. Measured: rule "fusion".
  double deviation = 0.02;
};

using UncertainMarkers = std::tuple<Array<bool, 1>, bool>;

// (M,) the uncertain markers by their covariances (M, 2, 2) and edges (M,); and whether there are any.
UncertainMarkers find_uncertain_markers(View<const double, 3> cov, View<const double, 1> edge_px,
                                        const UncertainLimits& limits);

// Fuses a marker, xy (2,) and cov (2, 2), with an independent prediction (2,) of its place, px.
//
// With the marker's covariance P and the prediction's V = variance * I, px^2, the marker moves by P (P +
// V)^-1 of the difference, and its covariance becomes V (P + V)^-1 P.
void update_by_fusion(View<double, 1> xy, View<double, 2> cov, View<const double, 1> predicted,
                      double variance);

}  // namespace cmp::complete
