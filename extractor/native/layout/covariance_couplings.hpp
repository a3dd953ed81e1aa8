// The couplings of gridlines' ends with which the inverse of the information is the covariance of the
// outermost layers; see extractor/layout/gridline_slopes.py.
#pragma once

#include "base/array.hpp"

namespace cmp::layout {

// The weights of markers in the slopes of E gridlines.
struct SlopeWeights {
  View<const std::int64_t, 2> ids;      // (E, K)
  View<const double, 3> leave, arrive;  // (2, E, K) by tangents and by second derivatives

  CMP_RECORD("extractor.layout.gridline_slopes.SlopeWeights", ids, leave, arrive)
};

// The gridlines of M markers.
struct LayoutGridlines {
  View<const std::int64_t, 2> edges;   // (E, 2)
  View<const double, 2> vectors;       // (E, 2) from start to end
  View<const bool, 1> is_seen;         // (E,)
  View<const std::int32_t, 2> spokes;  // (M, 6) the gridlines at each marker, -1 for none
  View<const bool, 1> is_inner;        // (M,)

  CMP_RECORD("extractor.layout.gridline_slopes.LayoutGridlines", edges, vectors, is_seen, spokes, is_inner)
};

struct CouplingLimits {
  // of l and a in the products of the offset t (1 - t) (l (1 - t) - a t) with 1 - t and with t. Derived.
  double bent_sums[2][2] = {{1.0 / 20, 1.0 / 30}, {-1.0 / 30, -1.0 / 20}};
  // whose covariances are compared with those of the outermost layers: three rings. Chosen.
  std::int64_t inner_markers = 37;
  // of the couplings by their covariances: the third changes them by less than 0.1 %. Chosen.
  std::int64_t rounds = 3;
  // of a marker's block. Derived: it only keeps a division from failing.
  double least_sum = 1e-6;
};

// (E, 6) the couplings of the covariances, from the ``end_couplings`` (E, 6).
Array<double, 2> covariance_couplings(View<const double, 2> couplings, const SlopeWeights& slopes,
                                      const LayoutGridlines& gridlines, const CouplingLimits& limits);

}  // namespace cmp::layout
