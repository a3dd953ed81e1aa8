// The scatter of the markers: how far each lies off a smooth map by itself.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "layout/topology.hpp"

namespace cmp::refine {

// Independent scatter of the markers of a picture, each by itself.
struct MarkerScatter {
  double variance_px2;  // of one axis
  double share;         // 0 to 1, of the variance of the fourth differences

  CMP_RECORD("extractor.refine.measure.marker_scatter.MarkerScatter", variance_px2, share)

  // px^2, the variance of a gridline's b; bending (3,), the gridline's scatter_bending of the topology
  double bend_variance(View<const double, 1> bending) const {
    const double tangents = 1.0 - share;
    return variance_px2 * (tangents * tangents * bending[0] + 2.0 * tangents * share * bending[1] +
                           share * share * bending[2]);
  }
};

// Limits of the scatter.
struct ScatterLimits {
  // variance of fourth differences over that of third differences, at most, without scatter. On bulges and
  // twists of the suite "plain" it is 0.14 to 0.41 (`python -m benchmarks.calibration --suite plain`). With
  // 0.3, dents and balls on patterns of 4 and 6 layers (`tests/extractor/refine/test_bending.py`) were taken
  // for scatter; with 1.5 hardly any are, and their errors do not rise. Measured by both.
  double smooth_ratio = 1.5;
  // stated variances of a marker that are noise, not scatter. On the flat patterns of that suite fourth
  // differences ask for 1.0 to 1.5, in steep views for 7 after the first step; a scatter of 0.05 px makes 40
  // to 60. Measured: rule "scatter".
  double noise_allowance = 8.0;
  // of the squared differences, by which their variance is measured: scatter is everywhere, and rims, slips
  // and dirt are somewhere. By the median, a slip of a tenth of an edge on a pattern of 4 layers was taken
  // for scatter, and its errors rose by a half. Measured: rule "scatter".
  double quantile = 0.25;
};

// The scatter, from the third and fourth differences of the markers along their gridlines.
//
// xy (M, 2) px, NaN where unknown; maps (M, 2, 5), as local_maps gives them; diagonal (M, 3) 1/px^2, the
// information's diagonal blocks.
MarkerScatter measure_scatter(View<const double, 2> xy, View<const double, 3> maps,
                              View<const double, 2> diagonal, const layout::Topology& topology,
                              const ScatterLimits& limits);

}  // namespace cmp::refine
