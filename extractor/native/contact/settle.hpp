// Tractions of some loads under which markers move as measured, where none of the loads pulls.
#pragma once

#include "base/array.hpp"

namespace cmp::contact {

// Of the loads that press, K of the S that were given.
struct Settled {
  Array<std::int64_t, 1> kept;  // (K,) their places among the loads that were given
  Array<double, 2> traction;    // (K, 3) in Young's moduli
  Array<double, 2> inverse;     // (3 K, 3 K) covariance of the tractions by the noise
  Array<double, 1> residual;    // (R,) whitened

  CMP_RECORD("extractor.contact.active_set.Settled", kept, traction, inverse, residual)
};

// Minimises |white - W A t|^2 + information |t|^2. Loads whose z does not press, below 0, leave together,
// until all press.
//
// by_load (S, 3, R), the measured numbers by the traction of a load; whitening (M, C, C) and white (R,), R =
// M C.
Settled settle(View<const float, 3> by_load, View<const double, 3> whitening, View<const double, 1> white,
               double information);

}  // namespace cmp::contact
