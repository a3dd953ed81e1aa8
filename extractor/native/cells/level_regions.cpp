#include "cells/level_regions.hpp"

#include <bit>
#include <cstring>

#include "base/processor.hpp"

namespace cmp::cells {

namespace {

constexpr Index BANDS = 4;          // of a tile
constexpr float FIXED_ONE = 64.0F;  // of a level; interpolated levels are integers

// A horizontal run of pixels above the level.
struct Run {
  std::int32_t begin, end, row;  // pixels begin to end - 1
};

// The sums of the powers of whole numbers from 0 to n - 1, for runs.
struct PowerSums {
  double n1, n2, n3;
};
PowerSums power_sums(double n) {
  const double m = n - 1.0, first = 0.5 * m * n;
  return {first, m * n * (2.0 * m + 1.0) / 6.0, first * first};
}

void add_run(MomentSums& sums, const Run& run) {
  const double y = run.row, n = run.end - run.begin;
  const PowerSums a = power_sums(run.begin), b = power_sums(run.end);
  const double x1 = b.n1 - a.n1, x2 = b.n2 - a.n2, x3 = b.n3 - a.n3;
  auto& m = sums.of;
  m[0] += n, m[1] += x1, m[2] += n * y, m[3] += x2, m[4] += x1 * y, m[5] += n * y * y;
  m[6] += x3, m[7] += x2 * y, m[8] += x1 * y * y, m[9] += n * y * y * y;
}

// Writes the levels of a row of tiles at each pixel of a row, in 1 / FIXED_ONE, between the middles of tiles.
void fill_wide(View<const float, 1> tiles, Index tile_px, View<float, 1> out) {
  const Index half = tile_px / 2, columns = tiles.size();
  out.slice(0, std::min(half, out.size())).fill(FIXED_ONE * tiles[0]);
  for (Index tile = 0; tile < columns; ++tile) {
    const float from = FIXED_ONE * tiles[tile], to = FIXED_ONE * tiles[std::min(tile + 1, columns - 1)];
    const float step = (to - from) / static_cast<float>(tile_px);
    const Index begin = half + tile * tile_px, end = std::min(begin + tile_px, out.size());
    for (Index x = begin; x < end; ++x) out[x] = from + step * static_cast<float>(x - begin);
  }
}

CMP_PART_OF_LOOP void fill_between(View<const float, 1> above, View<const float, 1> below, float share,
                                   View<std::int16_t, 1> out) {
  for (Index x = 0; x < out.size(); ++x)
    out[x] = static_cast<std::int16_t>(static_cast<std::int32_t>(above[x] + share * (below[x] - above[x])));
}

// Writes the level of each pixel of row y; wide (R, width), the levels of each row of tiles.
void fill_row_levels(View<const float, 2> wide, Index tile_px, Index y, View<std::int16_t, 1> out) {
  const Index last = wide.size() - 1;
  const float place = (static_cast<float>(y) + 0.5F) / static_cast<float>(tile_px) - 0.5F;
  const float inside = std::min(std::max(place, 0.0F), static_cast<float>(last));
  const Index above = std::min<Index>(static_cast<Index>(inside), std::max<Index>(last - 1, 0));
  fill_between(wide[above], wide[std::min(above + 1, last)], inside - static_cast<float>(above), out);
}

CMP_PART_OF_LOOP void fill_mask(View<const std::uint8_t, 1> values, View<const std::int16_t, 1> levels,
                                View<std::uint8_t, 1> mask) {
  for (Index x = 0; x < values.size(); ++x)
    mask[x] = static_cast<std::int16_t>(values[x] * static_cast<std::int16_t>(FIXED_ONE)) > levels[x];
}

// Adds the runs of ones of a row's mask, which ends with a multiple of eight bytes.
void add_runs(View<const std::uint8_t, 1> mask, std::int32_t row, std::vector<Run>& runs) {
  bool is_inside = false;
  for (Index x = 0; x < mask.size(); x += 8) {
    std::uint64_t word;
    std::memcpy(&word, &mask[x], 8);
    // a one at each byte at which the mask changes
    std::uint64_t changes = word ^ (word << 8) ^ (is_inside ? 1U : 0U);
    while (changes != 0) {
      const auto place = static_cast<std::int32_t>(x + std::countr_zero(changes) / 8);
      if (is_inside)
        runs.back().end = place;
      else
        runs.push_back({place, place, row});
      is_inside = !is_inside;
      changes &= changes - 1;
    }
  }
}

// Regions as trees of runs.
class Forest {
 public:
  explicit Forest(std::size_t runs) : parent_(runs) {
    for (std::size_t i = 0; i < runs; ++i) parent_[i] = static_cast<std::int32_t>(i);
  }
  std::int32_t root(std::int32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::int32_t a, std::int32_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> parent_;
};

// The runs of a map above its level.
std::vector<Run> runs_above(const image::ContrastMap& map, double share, double min_contrast) {
  const Index height = map.value.size(0), width = map.value.size(1);
  Array<float, 2> tiles(map.low.shape());
  const auto least = static_cast<float>(min_contrast), part = static_cast<float>(share);
  for (Index i = 0; i < tiles.count(); ++i)
    tiles.flat()[i] = map.low.view().flat()[i] +
                      std::max(part * (map.high.view().flat()[i] - map.low.view().flat()[i]), least);
  std::vector<Run> runs;
  runs.reserve(static_cast<std::size_t>(height) * 16);
  Array<std::int16_t, 1> levels({width});
  Array<float, 2> wide({tiles.size(), width});
  for (Index row = 0; row < tiles.size(); ++row) fill_wide(tiles[row], map.tile_px, wide[row]);
  Array<std::uint8_t, 1> mask({(width + 8) / 8 * 8}, std::uint8_t{0});  // ends outside a region
  const Index band = std::max<Index>(map.tile_px / BANDS, 1);           // rows with the same levels, for time
  for (Index y = 0; y < height; ++y) {
    if (y % band == 0) fill_row_levels(wide, map.tile_px, y + band / 2, levels);
    fill_mask(map.value[y], levels, mask.slice(0, width));
    add_runs(mask, static_cast<std::int32_t>(y), runs);
  }
  return runs;
}

}  // namespace

std::vector<MomentSums> level_regions(const image::ContrastMap& map, double share, double min_contrast,
                                      double min_area, double max_area) {
  const std::vector<Run> runs = runs_above(map, share, min_contrast);
  Forest forest(runs.size());
  std::size_t before = 0;  // the first run of the row before that may touch
  for (std::size_t i = 0; i < runs.size(); ++i) {
    while (before < i && (runs[before].row + 1 < runs[i].row ||
                          (runs[before].row + 1 == runs[i].row && runs[before].end <= runs[i].begin)))
      ++before;
    for (std::size_t k = before; k < i && runs[k].row + 1 == runs[i].row && runs[k].begin < runs[i].end; ++k)
      forest.join(static_cast<std::int32_t>(i), static_cast<std::int32_t>(k));
  }
  std::vector<std::int32_t> number(runs.size(), -1);
  std::vector<double> area;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::int32_t root = forest.root(static_cast<std::int32_t>(i));
    if (number[root] < 0) {
      number[root] = static_cast<std::int32_t>(area.size());
      area.push_back(0.0);
    }
    number[i] = number[root];
    area[number[i]] += runs[i].end - runs[i].begin;
  }
  std::vector<std::int32_t> kept(area.size(), -1);
  std::vector<MomentSums> regions;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::int32_t region = number[i];
    if (area[region] < min_area || area[region] > max_area) continue;
    if (kept[region] < 0) {
      kept[region] = static_cast<std::int32_t>(regions.size());
      regions.emplace_back();
    }
    add_run(regions[kept[region]], runs[i]);
  }
  return regions;
}

}  // namespace cmp::cells
