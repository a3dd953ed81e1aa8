// Room "solve" for Python.
#include "base/binding.hpp"

#include "refine/solve/convergence.hpp"
#include "refine/solve/fisher_information.hpp"

namespace cmp::refine {

void add_solve(nb::module_ module) {
  bind<&step_remainder>(module, "step_remainder",
                        {"measured", "drawn", "last", "sigma", "remaining_share", "diagonal"});
  bind<&solve_shifts>(module, "solve_shifts", {"diagonal", "off_diagonal", "edges", "right", "whole"});
  bind<&covariances>(module, "covariances",
                     {"diagonal", "off_diagonal", "edges", "spokes", "min_information", "selected"});
}

}  // namespace cmp::refine
