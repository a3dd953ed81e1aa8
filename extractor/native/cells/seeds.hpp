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
  std::int64_t safe_area_px;
  double max_small_share;

  template <class F>
  static DomainLimits read(const F& f) {
    return {f["min_domain_px"], f["min_cluttered_px"], f["min_solidity"], f["safe_area_px"],
            f["max_small_share"]};
  }
};

// area_px (D,), runs (R, 4), domain (R,), cluttered and has_large_domains of Seeds.
using FoundDomains =
    std::tuple<Array<std::int64_t, 1>, Array<std::int32_t, 2>, Array<std::int32_t, 1>, bool, bool>;
// Seeds (D, 2), the domains' centers (D, 2), px, and their inks (D,).
using SeedPoints = std::tuple<Array<std::int32_t, 2>, Array<double, 2>, Array<std::uint8_t, 1>>;

// The domains that are large enough, or, of more than max_domains, those that may be cells.
//
// label (H, W), the ink of each pixel or 0.
FoundDomains find_domains(View<const std::uint8_t, 2> label, Index max_domains, const DomainLimits& limits);

// The seed of each domain, its pixel nearest to its center; runs (R, 4), domain (R,), area (D,).
SeedPoints seed_points(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                       View<const std::int64_t, 1> area);

// (D, 10) the moments of domains about their seeds (D, 2); runs (R, 4), domain (R,).
//
// Each run is added at once, by its middle and length. All numbers are exact: multiples of 1/8.
Array<double, 2> domain_moments(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                                View<const std::int32_t, 2> seed_xy);

}  // namespace cmp::cells
