// The Fisher information matrix of the markers, its sparse solution and the diagonal blocks of its inverse.
#pragma once

#include "base/array.hpp"
#include "refine/solve/shared_pixels.hpp"

namespace cmp::refine {

// Blocks of the information matrix, 1/px^2.
struct Information {
  View<const double, 2> diagonal;      // (M, 3) xx, xy, yy of every marker
  View<const double, 2> off_diagonal;  // (E, 4) xx, xy, yx, yy from an edge's smaller to its larger marker

  CMP_RECORD("extractor.refine.solve.fisher_information.Information", diagonal, off_diagonal)
};

// The same, with memory of its own.
struct InformationArrays {
  Array<double, 2> diagonal, off_diagonal;

  CMP_RECORD("extractor.refine.solve.fisher_information.Information", diagonal, off_diagonal)
  operator Information() const { return {diagonal, off_diagonal}; }
};

// Gridlines with the measurements along them, and the markers that they join.
struct GridlineSystem {
  View<const double, 2> sums;          // (E, 24) sums over the pixels, columns of residual_kernel
  View<const double, 1> weight;        // (E,) 0 to 1; a gridline that is not drawn counts as 0
  View<const double, 2> lines;         // (E, 8), as gridlines gives them
  View<const double, 2> contrasts;     // (E, 3) gray levels
  View<const double, 2> curving;       // (E, 3), as curving gives it
  View<const std::int32_t, 2> edges;   // (E, 2) the markers at the gridlines' ends
  View<const std::int32_t, 2> spokes;  // (M, 6) the gridlines at each marker, -1 for none
  double sigma;                        // the blur, px
  double variance;                     // of the noise, squared gray levels, one channel
  double scatter_share;                // 0 to 1, as in MarkerScatter
};

// Limits of the information, of its solution and of its inverse.
struct InformationLimits {
  // 1/px^2, of a marker that is held in place. Derived: more than any image holds.
  double held_information = 1000000000000.0;
  Index max_steps = 80;      // of the conjugate gradients. Chosen.
  double precision = 0.003;  // of the solution, relative. Chosen.
  // of a marker's block, relative to its squared trace; with less a direction is unknown, and the marker has
  // no covariance. Chosen.
  double min_determinant = 1e-6;
  SharedPixelLimits shared;
};

// (E, 3) how much more than straight lines the gridlines move with their start, with their end, and with the
// other end.
//
// couplings (E, 6), the topology's end_couplings; scatter_share, 0 to 1, as in MarkerScatter; bend_response
// (E, 7), as update_without_bending gives it: a gridline that is free to bend stays where the image shows it.
Array<double, 2> curving(View<const double, 2> couplings, double scatter_share,
                         View<const double, 2> bend_response);

// The information about the markers, with gridlines that curve with their own two ends.
//
// prior (M,) 1/px^2, before the measurement. Pixels that gridlines share are not in it.
InformationArrays fisher_information(const GridlineSystem& system, View<const double, 1> prior);

// Changes the information to that of gridlines with this curving (E, 3) in the place of the system's.
void update_curving(InformationArrays& information, const GridlineSystem& system,
                    View<const double, 2> curving);

// (M, 2) 1/px, the gradient of the log-likelihood at each marker.
//
// gradient_start, gradient_end (E,) squared gray levels / px, along the normal of each gridline at its ends.
Array<double, 2> gradient(const GridlineSystem& system, View<const double, 1> gradient_start,
                          View<const double, 1> gradient_end);

// (M, 2) 1/px, what the shifts (M, 2) px leave of the gradient (M, 2) 1/px.
Array<double, 2> remaining_gradient(const Information& information, View<const std::int32_t, 2> edges,
                                    View<const double, 2> gradient, View<const double, 2> shift);

// (M, 2) px, the shifts of the markers, by conjugate gradients preconditioned with the diagonal blocks.
//
// The descent ends early where the whole matrix is not positive definite. diagonal (M, 3) positive definite
// blocks and off_diagonal (E, 4), 1/px^2; edges (E, 2), the markers that each off-diagonal block joins; right
// (M, 2) 1/px, the gradient; whole (M, 2) 1/px, the gradient relative to which the solution is precise.
Array<double, 2> solve_shifts(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                              View<const std::int32_t, 2> edges, View<const double, 2> right,
                              View<const double, 2> whole, const InformationLimits& limits);

// (M, 2, 2) px^2, the markers' covariances: diagonal blocks of the inverse, from each marker and its
// neighbours; NaN where nothing is known and where not selected.
//
// The markers beyond the neighbours are eliminated one by one, as if they were not connected to each other,
// then the neighbours. diagonal (M, 3) and off_diagonal (E, 4), 1/px^2; edges (E, 2) and spokes (M, 6), as in
// Topology; min_information 1/px^2, below which a marker counts as unknown; selected (M,), the markers to
// compute.
Array<double, 3> covariances(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                             View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes,
                             double min_information, View<const bool, 1> selected,
                             const InformationLimits& limits);

}  // namespace cmp::refine
