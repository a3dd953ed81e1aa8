// Dot gain: all cells look larger than they are, by the same width, as inks run out or the camera is not
// linear.
//
// Every gridline then lies off towards the black beside the gridline. Around a marker where colored and black
// cells alternate this cancels. At the pattern's rim it does not: an acute corner there moves outward by
// several widths.
#pragma once

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::refine {

// Limits of dot gain.
struct DotGainLimits {
  // gridlines that the dot gain is measured from; with no more than the least, it is taken as 0, and of more
  // than the most, every n-th is used. Chosen.
  Index min_gridlines = 40, max_gridlines = 250;
  // in units of the blur; drawings, compression and glare look like less, which is taken as 0. Chosen.
  double min_dot_gain = 0.1;
  double min_sine = 0.2;  // of the angle of a corner; a sharper corner moves no farther. Chosen.
  // of the deviation of the gridlines' shifts, beyond which a shift counts as this. Chosen.
  double max_deviations = 3.0;
  double correlated = 8.0;  // gridlines whose errors are alike; as many count as one. Chosen.
};

// px, the dot gain: the median shift outward of the sides of cells at the pattern's rim; 0 where the shift is
// small, or few gridlines were read.
//
// sums (E, 24), as accumulate_residual_sums gives them; contrasts (E, 3) gray levels; edge_cells (E, 2) the
// drawn cells on both sides, -1 for none; sigma px, the blur.
double measure_dot_gain(View<const double, 2> sums, const ShiftGradients& gradients,
                        View<const double, 2> contrasts, View<const std::int32_t, 2> edge_cells, double sigma,
                        const DotGainLimits& limits);

// Changes of the dot gain over the image beyond what noise explains, px/px, 0 or more.
struct UnevenDotGain {
  double outward = 0.0;  // with the distance from the image's middle
  double across = 0.0;   // from one side of the image to the other
};

// The changes of the dot gain, by a cone and a plane through the shifts of gridlines inside the pattern.
//
// sums to edge_cells as above; xy (M, 2) px; width and height of the image, px.
UnevenDotGain measure_uneven_dot_gain(View<const double, 2> sums, const ShiftGradients& gradients,
                                      View<const double, 2> contrasts, View<const double, 2> xy,
                                      const layout::Topology& topology, double width, double height,
                                      const DotGainLimits& limits);

// (E,) px, the shift of each gridline along its normal by the dot gain, px; sums (E, 24).
Array<double, 1> dot_gain_offsets(View<const double, 2> sums, View<const double, 2> contrasts,
                                  View<const std::int32_t, 2> edge_cells, double dot_gain);

// Removes shifts (E,) px of the gridlines along their normals from their sums (E, 24) and gradients.
void update_without_offsets(View<double, 2> sums, ShiftGradients& gradients, View<const double, 1> offset);

// (M, 2) px: markers xy, which are means of the corners of the enlarged cells (K, 3), moved back inward.
Array<double, 2> markers_without_dot_gain(View<const double, 2> xy, View<const std::int32_t, 2> cells,
                                          double dot_gain, const DotGainLimits& limits);

}  // namespace cmp::refine
