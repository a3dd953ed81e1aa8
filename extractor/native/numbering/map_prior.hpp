// The prior of the maps by which parts are registered and cells predicted.
#pragma once

#include "localmap/local_map.hpp"

namespace cmp::numbering {

// Lengths are in edges; a term of degree k has the unit edge per edge^k.
struct MapPriorLimits {
  double noise = 0.08;      // standard deviation of a cell's centre. Chosen.
  double quadratic = 0.05;  // of the terms of degree 2. Chosen.
  double cubic = 0.01;      // of the terms of degree 3. Chosen.

  // of a map whose terms deviate by this share of the prior
  localmap::MapRidge ridge(double share) const {
    const double square = noise / (share * quadratic), cube = noise / (share * cubic);
    return {.square = square * square, .mixed = square * square, .cubic = cube * cube};
  }
};

}  // namespace cmp::numbering
