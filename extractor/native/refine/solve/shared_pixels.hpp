// The pixels near a marker, which the gridlines that meet there share.
#pragma once

#include <array>
#include <vector>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::refine {

struct GridlineSystem;

inline constexpr Index CLOSED_FORM_TERMS = 9;

// Limits of shared pixels; explained in extractor/refine/solve/shared_pixels.py.
struct SharedPixelLimits {
  double max_cosine, min_end_information, min_uncut_information;
  std::array<double, CLOSED_FORM_TERMS> plain_form, linear_form;

  template <class F>
  static SharedPixelLimits read(const F& f) {
    return {f["max_cosine"], f["min_end_information"], f["min_uncut_information"], f["plain_form"],
            f["linear_form"]};
  }
};

inline constexpr std::size_t MARKER_LANES = 8;  // markers side by side
inline constexpr auto MARKER_GRIDLINES = static_cast<std::size_t>(layout::SPOKES);
inline constexpr std::size_t MARKER_PAIRS = MARKER_GRIDLINES * (MARKER_GRIDLINES - 1) / 2;

using LaneRow = std::array<double, MARKER_LANES>;

// The overlaps of two gridlines at each of `MARKER_LANES` markers, squared gray levels / px^2.
struct LaneOverlaps {
  LaneRow near;        // of near end with near end
  LaneRow far_first;   // of the second gridline's near end with the first gridline's far end
  LaneRow far_second;  // of the first gridline's near end with the second gridline's far end
};

using MarkerOverlaps = std::array<LaneOverlaps, MARKER_PAIRS>;

// The pixels that the gridlines of a system share at its markers.
class SharedPixels {
 public:
  SharedPixels(const GridlineSystem& system, const SharedPixelLimits& limits);

  // Adds the information of the pixels, with the weights of the system, to the matrix: diagonal (M, 3) and
  // off_diagonal (E, 4), 1/px^2, written.
  void add_information(const GridlineSystem& system, View<double, 2> diagonal,
                       View<double, 2> off_diagonal) const;

  // Removes from the gridlines' gradients what the shifts (M, 2) px of the other gridlines at their ends
  // explain.
  void update_explained(const GridlineSystem& system, View<const double, 2> shift,
                        ShiftGradients& left) const;

 private:
  std::vector<MarkerOverlaps> overlaps_;  // of each `MARKER_LANES` markers
};

}  // namespace cmp::refine
