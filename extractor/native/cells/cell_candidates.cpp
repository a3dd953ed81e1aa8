#include "cells/cell_candidates.hpp"

#include <cmath>
#include <numeric>
#include <vector>

#include "cells/level_regions.hpp"

namespace cmp::cells {

namespace {

constexpr double EQUILATERAL = 0.4330127018922193;  // area over the square of the side

// A triangle with the size of its side.
struct Candidate {
  double x, y, area, quality, share;
  std::array<double, 6> corner;
};

// Buckets of places, in which a place's neighbours are looked up.
class Places {
 public:
  Places(const std::vector<Candidate>& all, double step) : step_(std::max(step, 1.0)) {
    for (const Candidate& one : all) {
      columns_ = std::max(columns_, static_cast<Index>(one.x / step_) + 1);
      rows_ = std::max(rows_, static_cast<Index>(one.y / step_) + 1);
    }
    buckets_.resize(static_cast<std::size_t>(columns_ * rows_));
  }
  // Whether a kept place is nearer than its own radius or the one given; else keeps the place.
  bool is_taken(const Candidate& one, double share) const {
    const double own = radius_of(one, share);
    const Index reach = static_cast<Index>(own / step_) + 1;
    const auto column = static_cast<Index>(one.x / step_), row = static_cast<Index>(one.y / step_);
    for (Index r = std::max<Index>(row - reach, 0); r <= std::min(row + reach, rows_ - 1); ++r)
      for (Index c = std::max<Index>(column - reach, 0); c <= std::min(column + reach, columns_ - 1); ++c)
        for (const Candidate* kept : buckets_[static_cast<std::size_t>(r * columns_ + c)]) {
          const double radius = std::max(own, radius_of(*kept, share));
          const double dx = kept->x - one.x, dy = kept->y - one.y;
          if (dx * dx + dy * dy < radius * radius) return true;
        }
    return false;
  }
  void keep(const Candidate& one) {
    const auto column = static_cast<Index>(one.x / step_), row = static_cast<Index>(one.y / step_);
    buckets_[static_cast<std::size_t>(row * columns_ + column)].push_back(&one);
  }

 private:
  static double radius_of(const Candidate& one, double share) {
    return share * std::sqrt(one.area / EQUILATERAL);
  }

  double step_;
  Index columns_ = 1, rows_ = 1;
  std::vector<std::vector<const Candidate*>> buckets_;
};

// The level of a region as a share of its own contrast; its true outline is at a half.
double own_share(const image::ContrastMap& map, const MomentShape& shape, double share, double least) {
  const auto x = static_cast<Index>(shape.x + 0.5), y = static_cast<Index>(shape.y + 0.5);
  const double low = map.low(y / map.tile_px, x / map.tile_px),
               high = map.high(y / map.tile_px, x / map.tile_px);
  return std::max(share * (high - low), least) / std::max(map.value(y, x) - low, 1.0);
}

// The triangles of some maps at some levels.
std::vector<Candidate> candidates_of(View<const std::uint8_t, 3> image, View<const std::int64_t, 1> maps,
                                     View<const double, 1> shares, Index tile_px,
                                     const CandidateLimits& limits) {
  std::vector<Candidate> all;
  const auto channels = image::smoothed_channels(image);
  const double least = limits.min_contrast_deviations * std::max(image::channel_noise(channels), 0.3);
  const double most = limits.max_area_share * static_cast<double>(image.size(0) * image.size(1));
  for (const std::int64_t number : maps) {
    const auto map = image::contrast_map(channels, number, tile_px);
    for (const double share : shares)
      for (const MomentSums& sums : level_regions(map, share, least, limits.min_area_px, most)) {
        const MomentShape shape = shape_of(sums);
        const double triangle = limits.shape.quality(shape);
        if (triangle <= 0.0) continue;
        const double quality =
            triangle - limits.level_weight * std::abs(std::log(2.0 * own_share(map, shape, share, least)));
        Candidate found{shape.x, shape.y, sums.area(), quality, share, {}};
        fill_corners(shape, View<double, 2>(found.corner.data(), {3, 2}));
        all.push_back(found);
      }
  }
  return all;
}

}  // namespace

FoundCells find_candidates(View<const std::uint8_t, 3> image, View<const std::int64_t, 1> maps,
                           View<const double, 1> shares, const KnownCells& known, Index tile_px,
                           const CandidateLimits& limits) {
  std::vector<Candidate> all = candidates_of(image, maps, shares, tile_px, limits);
  for (Index i = 0; i < known.area_px.size(); ++i) {
    Candidate one{known.centre_px(i, 0), known.centre_px(i, 1), known.area_px[i],
                  known.quality[i],      known.share[i],        {}};
    for (Index k = 0; k < 6; ++k) one.corner[k] = known.corner_px(i, k / 2, k % 2);
    all.push_back(one);
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Candidate& a, const Candidate& b) { return a.quality > b.quality; });
  double mean = 0.0;
  for (const Candidate& one : all)
    mean += std::sqrt(one.area / EQUILATERAL) / static_cast<double>(all.size());
  Places places(all, 0.5 * mean);
  std::vector<const Candidate*> kept;
  for (const Candidate& one : all) {
    if (places.is_taken(one, limits.same_place)) continue;
    places.keep(one);
    kept.push_back(&one);
  }
  const auto number = static_cast<Index>(kept.size());
  FoundCells out{Array<double, 2>({number, 2}), Array<double, 1>({number}), Array<double, 3>({number, 3, 2}),
                 Array<double, 1>({number}), Array<double, 1>({number})};
  for (Index i = 0; i < number; ++i) {
    out.centre_px(i, 0) = kept[i]->x, out.centre_px(i, 1) = kept[i]->y;
    out.area_px[i] = kept[i]->area, out.quality[i] = kept[i]->quality, out.share[i] = kept[i]->share;
    for (Index k = 0; k < 6; ++k) out.corner_px(i, k / 2, k % 2) = kept[i]->corner[k];
  }
  return out;
}

}  // namespace cmp::cells
