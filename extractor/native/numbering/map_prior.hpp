// The prior of the maps by which parts are registered and cells predicted.
#pragma once

#include "localmap/local_map.hpp"

namespace cmp::numbering {

// Lengths are in edges; a term of degree k has the unit edge per edge^k. Explained in witnesses.py.
struct MapPrior {
  double noise;      // standard deviation of a point
  double quadratic;  // of the terms of degree 2
  double cubic;      // of the terms of degree 3

  CMP_FIELDS(noise, quadratic, cubic)

  // of a map whose terms deviate by this share of the prior
  localmap::MapRidge ridge(double share = 1.0) const {
    const double square = noise / (share * quadratic), cube = noise / (share * cubic);
    return {.square = square * square, .mixed = square * square, .cubic = cube * cube};
  }
};

}  // namespace cmp::numbering
