// Stage 3: the pixel domains of the inks, one seed for each, and the domains' moments.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::cells {

// Twin of MOMENT_TERMS of the Python module.
inline constexpr int MOMENT_TERMS = 10;  // 1, x, y, xx, xy, yy, xxx, xxy, xyy, yyy about the seed

// The limits of the domains; the Python module explains them.
struct DomainLimits {
  std::int64_t min_domain_px;
  std::int64_t min_cluttered_px;
  double min_solidity;

  template <class F>
  static DomainLimits read(const F& f) {
    return {f["min_domain_px"], f["min_cluttered_px"], f["min_solidity"]};
  }
};

// Runs (R, 4) of one ink: y, first x, last x, ink; and (R,) an earlier run of the domain of each run, or
// itself.
using FoundRuns = std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 1>>;
// Runs (R, 4), the domain (R,) of each, the areas (D,) of the domains, px^2, and whether there were too many.
using FoundDomains = std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 1>, Array<std::int64_t, 1>, bool>;
// Seeds (D, 2), the domains' centers (D, 2), px, and their inks (D,).
using SeedPoints = std::tuple<Array<std::int32_t, 2>, Array<double, 2>, Array<std::uint8_t, 1>>;

// The horizontal runs of one ink, connected with the adjacent runs of their ink in the row above
// (4-neighbours).
//
// label (H, W), the ink of each pixel or 0.
FoundRuns find_runs(View<const std::uint8_t, 2> label);

// Selects the domains that are large enough, or, of more than max_domains, those that may be cells.
//
// runs (R, 4), parent (R,) as found.
FoundDomains find_domains(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> parent,
                          Index max_domains, const DomainLimits& limits);

// The seed of each domain, its pixel nearest to its center; runs (R, 4), domain (R,), area (D,).
SeedPoints seed_points(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                       View<const std::int64_t, 1> area);

// (D, 10) the moments of domains about their seeds (D, 2); runs (R, 4), domain (R,).
//
// Each run is added at once, by its middle and length. All numbers are exact: multiples of 1/8.
Array<double, 2> domain_moments(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                                View<const std::int32_t, 2> seed_xy);

}  // namespace cmp::cells
