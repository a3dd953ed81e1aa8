#include "refine/synthesis/blur_bleed.hpp"

#include <cmath>

#include "numeric/median.hpp"

namespace cmp::refine {

namespace {

// (K,) px, the radii of the cells' inscribed circles, NaN where a corner is unknown.
Array<double, 1> inscribed_radii(View<const double, 2> xy, View<const std::int32_t, 2> cells) {
  Array<double, 1> out({cells.size()});
  for (Index i = 0; i < cells.size(); ++i) out[i] = inscribed_radius(CellCorners(xy, cells, i));
  return out;
}

// The share of each neighbour in the mean of a disc; the disc's size follows from the assumed blur, px.
double bleed_share(double inscribed, double assumed_sigma, double sigma, const DiscLimits& limits) {
  const double radius = disc_radius(inscribed, assumed_sigma, limits);
  // the pixels of a disc have the variance radius^2 / 4 in one direction
  return 0.5 * std::erfc(inscribed / std::sqrt(2.0 * (sigma * sigma + 0.25 * radius * radius)));
}

// The median of the numbers that are not NaN; NaN without any.
double median_of_known(View<const double, 1> values) {
  Array<double, 1> known({values.size()});
  Index count = 0;
  for (const double value : values) {
    known[count] = value;
    count += std::isnan(value) ? 0 : 1;
  }
  return numeric::median_of_many(known.slice(0, count));
}

}  // namespace

BleedShares bleed_shares(View<const double, 2> xy, View<const std::int32_t, 2> cells, double sigma,
                         double assumed_sigma, const BleedLimits& limits) {
  Array<double, 1> shares = inscribed_radii(xy, cells);
  for (double& share : shares) share = bleed_share(share, assumed_sigma, sigma, limits.disc);
  const double middle = median_of_known(shares);
  return {std::move(shares), middle};
}

LevelArrays remove_bleed(const InkLevels& levels, View<const std::int32_t, 1> color,
                         View<const double, 1> share, double median_share, const BleedLimits& limits) {
  LevelArrays out{Array<double, 2>(levels.cell), Array<double, 3>(levels.slope),
                  Array<double, 2>(levels.black), Array<bool, 1>(levels.is_outlier)};
  const auto cell = out.cell.view();
  const auto slope = out.slope.view();
  const auto black = out.black.view();
  const double most = limits.max_bleed, middle = std::min(median_share, most);
  std::array<double, 3> total{};
  Array<double, 1> own({cell.size()});
  for (std::int32_t ink = 0; ink < BLACK; ++ink) {
    for (Index channel = 0; channel < 3; ++channel) {
      Index count = 0;
      for (Index i = 0; i < cell.size(); ++i) {
        own[count] = cell(i, channel);
        count += color[i] == ink ? 1 : 0;
      }
      if (count > 0) total[channel] += numeric::median_of_many(own.slice(0, count)) / (1.0 - 6.0 * middle);
    }
  }
  for (Index i = 0; i < cell.size(); ++i) {
    const double b = std::min(std::max(std::isfinite(share[i]) ? share[i] : middle, -most), most);
    for (Index channel = 0; channel < 3; ++channel) {
      cell(i, channel) = (cell(i, channel) + b * total[channel]) / (1.0 - 3.0 * b);
      slope(i, channel, 0) /= 1.0 - 3.0 * b;
      slope(i, channel, 1) /= 1.0 - 3.0 * b;
    }
  }
  for (Index channel = 0; channel < 3; ++channel) black(channel, 0) -= middle * total[channel];
  return out;
}

LevelArrays levels_at_blur(const InkLevels& levels, View<const double, 2> xy,
                           View<const std::int32_t, 2> cells, View<const std::int32_t, 1> color,
                           double drawn_sigma, double sigma, const BleedLimits& limits) {
  Array<double, 1> change = inscribed_radii(xy, cells);
  const double size = median_of_known(change);
  const double before = bleed_share(size, 0.0, drawn_sigma, limits.disc);
  const double after = bleed_share(size, 0.0, sigma, limits.disc);
  const double remainder = 1.0 - 6.0 * std::min(before, limits.max_bleed);
  for (double& inscribed : change) {
    const double own_before = bleed_share(inscribed, 0.0, drawn_sigma, limits.disc);
    inscribed = (bleed_share(inscribed, 0.0, sigma, limits.disc) - own_before) / remainder;
  }
  return remove_bleed(levels, color, change, (after - before) / remainder, limits);
}

}  // namespace cmp::refine
