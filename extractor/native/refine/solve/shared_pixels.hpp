// The pixels near a marker, which the gridlines that meet there share.
//
// The derivatives by two gridlines with the directions a and b overlap by the integrals of t^i u^j exp(-|t a
// - u b|^2 / 4 s^2) / 4 pi s^2 over the two rays, which have closed forms.
#pragma once

#include <array>
#include <vector>

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_weights.hpp"

namespace cmp::refine {

struct GridlineSystem;

inline constexpr Index CLOSED_FORM_TERMS = 9;

// Limits of shared pixels, and the closed forms between them.
struct SharedPixelLimits {
  // of the angle between two gridlines, as which a smaller angle counts. Derived: the cosine of 0.4 rad; the
  // closed forms hold for long gridlines, which two at a smaller angle are not.
  double max_cosine = 0.9210609940028851;
  // least share of a gridline's information that is left where its ends are blurred. Chosen.
  double min_end_information = 0.75;
  // squared gray levels per px^2; the least information of a whole gridline by which is divided. Derived: it
  // only keeps a division from failing.
  double min_uncut_information = 1e-12;
  // coefficients of r a and r^3 b as polynomials in r = sqrt(1 - cosine), accurate to 1e-7. With s the sine
  // and p the angle between one gridline and the continuation of the other, a = p / s is the integral for i =
  // j = 0 and b = (s + p cosine) / s^3 that for i = j = 1. Derived: fitted by numpy's Polynomial to 400 equal
  // steps of r from max_cosine to -1 + 1e-3.
  std::array<double, CLOSED_FORM_TERMS> plain_form = {
      2.2214062300373105,  -0.9994802290228612,   0.5520335891256954,
      -0.3210889875190351, 0.17923857580966263,   -0.0861060251550025,
      0.03129883987192556, -0.007304348171856732, 0.0007986841926807503};
  // Derived likewise.
  std::array<double, CLOSED_FORM_TERMS> linear_form = {
      1.110807604846207,    -0.0012936914563040358, -0.26929083534531123,
      0.3018856779750332,   -0.235866054830842,     0.13721017833001403,
      -0.05580030238590822, 0.013938322207913953,   -0.0015909046261314544};
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
