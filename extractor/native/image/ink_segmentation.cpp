#include "image/ink_segmentation.hpp"

#include <algorithm>
#include <vector>

namespace cmp::image {

namespace {

using Row = View<const std::uint8_t, 1>;

// The contiguous range of hues of an ink, modulo 180.
struct HueRange {
  std::uint8_t first, count;

  explicit HueRange(Row range) : first(range[0]), count(range[1]) {}

  // 1 for a hue in the range, else 0, in 8 bits: so many more pixels fit into one instruction
  std::uint8_t has(std::uint8_t hue) const {
    const auto wrapped = static_cast<std::uint8_t>(hue < first ? HUES : 0);
    const auto offset = static_cast<std::uint8_t>(hue - first + wrapped);
    return offset < count ? 1 : 0;
  }
};

// Raises the strongest chroma (W,) to that of the row's pixels whose hue is in the range.
void update_strongest(Row hues, Row chromas, HueRange range, View<std::uint8_t, 1> strongest) {
  const auto width = strongest.size();
  for (Index x = 0; x < width; ++x) {
    const auto level = static_cast<std::uint8_t>(chromas[x] * range.has(hues[x]));
    // std::max of the element itself is no vector operation
    const std::uint8_t before = strongest[x];
    strongest[x] = std::max(before, level);
  }
}

// Calls visit(y, x) for the tile and its neighbours.
template <class Visit>
void for_neighbours(Index row, Index column, Index rows, Index columns, Visit visit) {
  for (Index y = std::max<Index>(row - 1, 0); y < std::min(row + 2, rows); ++y)
    for (Index x = std::max<Index>(column - 1, 0); x < std::min(column + 2, columns); ++x) visit(y, x);
}

// The upper quartile of the levels above 0; 0 without any.
double upper_quartile(View<const float, 2> level) {
  std::vector<float> found;
  for (Index y = 0; y < level.size(0); ++y)
    std::copy_if(level[y].begin(), level[y].end(), std::back_inserter(found),
                 [](float one) { return one > 0.0F; });
  if (found.empty()) return 0.0;
  const auto place = found.begin() + static_cast<Index>(3 * found.size() / 4);
  std::nth_element(found.begin(), place, found.end());
  return *place;
}

// Writes each tile's value into the pixels of a row that the tile covers.
void fill_upsampled_row(Row tiles, Index size, View<std::uint8_t, 1> row) {
  for (Index column = 0; column < tiles.size(); ++column) {
    const Index end = std::min((column + 1) * size, row.size());
    for (Index x = column * size; x < end; ++x) row[x] = tiles[column];
  }
}

// Writes one row of labels; limit (4, W): the three inks' thresholds, and 1 in the target area.
void fill_row_labels(Row hues, Row chromas, View<const std::uint8_t, 2> ranges,
                     View<const std::uint8_t, 2> limit, View<std::uint8_t, 1> out) {
  const HueRange red(ranges[0]), green(ranges[1]), blue(ranges[2]);
  const auto red_limit = limit[0], green_limit = limit[1], blue_limit = limit[2], inside = limit[3];
  const auto width = out.size();
  for (Index x = 0; x < width; ++x) {
    const std::uint8_t hue = hues[x], chroma = chromas[x];
    const std::uint8_t one = red.has(hue) & (chroma > red_limit[x] ? 1 : 0);
    const std::uint8_t two = green.has(hue) & (chroma > green_limit[x] ? 1 : 0);
    const std::uint8_t three = blue.has(hue) & (chroma > blue_limit[x] ? 1 : 0);
    out[x] = static_cast<std::uint8_t>(inside[x] * (one + 2 * two + 3 * three));
  }
}

// Every other pixel of every other row.
Array<std::uint8_t, 2> subsampled(View<const std::uint8_t, 2> plane) {
  Array<std::uint8_t, 2> out({(plane.size(0) + 1) / 2, (plane.size(1) + 1) / 2});
  for (Index y = 0; y < out.size(0); ++y) {
    const auto row = plane[2 * y];
    const auto line = out[y];
    const auto width = line.size();
    for (Index x = 0; x < width; ++x) line[x] = row[2 * x];
  }
  return out;
}

// (3, 2): the first hue of each ink's contiguous range and the number of hues in the range; inks (180,).
Array<std::uint8_t, 2> hue_ranges(View<const std::uint8_t, 1> inks) {
  Array<std::uint8_t, 2> ranges({INKS, 2}, 0);
  for (Index hue = 0; hue < HUES; ++hue) {
    const Index ink = inks[hue], before = inks[hue > 0 ? hue - 1 : HUES - 1];
    if (ink == 0) continue;
    ++ranges(ink - 1, 1);
    if (before != ink) ranges(ink - 1, 0) = static_cast<std::uint8_t>(hue);
  }
  return ranges;
}

// (3, rows, columns) the largest chroma of each ink in every tile; 0 where it is too small.
//
// hue, chroma (H, W); ranges (3, 2) by hue_ranges; tile: side of a tile, px.
Array<float, 3> tile_max_chroma(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                                View<const std::uint8_t, 2> ranges, Index tile, const LabelLimits& limits) {
  const auto height = hue.size(0), width = hue.size(1);
  const Index rows = (height + tile - 1) / tile, columns = (width + tile - 1) / tile;
  Array<float, 3> level({INKS, rows, columns}, 0.0F);
  Array<std::uint8_t, 1> buffer({width});
  const auto strongest = buffer.view();
  for (Index row = 0; row < rows; ++row) {
    for (Index ink = 0; ink < INKS; ++ink) {
      strongest.fill(0);
      for (Index y = row * tile; y < std::min((row + 1) * tile, height); ++y)
        update_strongest(hue[y], chroma[y], HueRange(ranges[ink]), strongest);
      for (Index column = 0; column < columns; ++column) {
        const auto own = strongest.slice(column * tile, std::min((column + 1) * tile, width));
        std::uint8_t largest = 0;
        for (std::uint8_t one : own) largest = std::max(largest, one);
        if (largest >= limits.min_chroma) level(ink, row, column) = largest;
      }
    }
  }
  return level;
}

// The levels of the inks.
struct TileThresholds {
  Array<std::uint8_t, 3> threshold;  // (3, rows, columns) the minimum chroma of an ink's pixels in each tile
  Array<double, 1> typical;          // (3,) the upper quartile of the ink's levels in all tiles
};

// The thresholds by the levels (3, rows, columns).
//
// A tile's local level is the mean, over the tile and its neighbours, of the largest level around each of
// these.
TileThresholds tile_thresholds(View<const float, 3> level, const LabelLimits& limits) {
  const auto rows = level.size(1), columns = level.size(2);
  Array<std::uint8_t, 3> threshold({INKS, rows, columns});
  Array<double, 1> typical({INKS}, 0.0);
  Array<float, 2> dilated({rows, columns});
  for (Index ink = 0; ink < INKS; ++ink) {
    const auto levels = level[ink];
    const auto dilated_levels = dilated.view();
    typical[ink] = upper_quartile(levels);
    for (Index row = 0; row < rows; ++row) {
      for (Index column = 0; column < columns; ++column) {
        float largest = 0.0F;
        for_neighbours(row, column, rows, columns,
                       [&](Index y, Index x) { largest = std::max(largest, levels(y, x)); });
        dilated_levels(row, column) = largest;
      }
    }
    for (Index row = 0; row < rows; ++row) {
      for (Index column = 0; column < columns; ++column) {
        double total = 0.0, count = 0.0;
        for_neighbours(row, column, rows, columns, [&](Index y, Index x) {
          total += dilated_levels(y, x);
          count += 1.0;
        });
        const double local = limits.level_share * (total / count);
        threshold(ink, row, column) = static_cast<std::uint8_t>(
            std::min(std::max(local, static_cast<double>(limits.min_chroma)), 255.0));
      }
    }
  }
  return {std::move(threshold), std::move(typical)};
}

// (H, W): each pixel's ink where its chroma exceeds the tile's threshold (3, rows, columns), inside the
// target area.
Array<std::uint8_t, 2> label_pixels(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                                    View<const std::uint8_t, 2> ranges, View<const std::uint8_t, 3> threshold,
                                    Index tile, const Target& target) {
  const auto height = chroma.size(0), width = chroma.size(1);
  Array<std::uint8_t, 2> label({height, width});
  Array<std::uint8_t, 2> limit({INKS + 1, width}, 0);
  for (Index y = 0; y < height; ++y) {
    if (y % target.tile_px == 0)
      fill_upsampled_row(target.mask[y / target.tile_px], target.tile_px, limit[INKS]);
    if (y % tile == 0) {
      for (Index ink = 0; ink < INKS; ++ink) fill_upsampled_row(threshold[ink][y / tile], tile, limit[ink]);
    }
    fill_row_labels(hue[y], chroma[y], ranges, limit, label[y]);
  }
  return label;
}

}  // namespace

SegmentedImage segment(View<const std::uint8_t, 2> hue, View<const std::uint8_t, 2> chroma,
                       const Target& target, View<const double, 1> nominal_deg, const LabelLimits& limits) {
  const Index height = chroma.size(0), width = chroma.size(1);
  const Index across = std::min(height, width) / limits.tiles_across / target.tile_px * target.tile_px;
  const Index tile = std::max(limits.tile_px, across);
  const bool is_large = height * width > limits.survey_pixels;
  Array<std::uint8_t, 2> some_hues, some_chroma;
  if (is_large) {
    some_hues = subsampled(hue);
    some_chroma = subsampled(chroma);
  }
  const View<const std::uint8_t, 2> survey_hue = is_large ? some_hues.view() : hue;
  const View<const std::uint8_t, 2> survey_chroma = is_large ? some_chroma.view() : chroma;
  auto [hues_deg, found] =
      find_hues(hue_weights(survey_hue, survey_chroma, limits.hues), nominal_deg, limits.hues);
  if (!found) return {};
  const Array<std::uint8_t, 2> ranges = hue_ranges(ink_of_hue(hues_deg, limits.hues));
  TileThresholds levels = tile_thresholds(
      tile_max_chroma(survey_hue, survey_chroma, ranges, is_large ? tile / 2 : tile, limits), limits);
  return {true, label_pixels(hue, chroma, ranges, levels.threshold, tile, target), std::move(hues_deg),
          std::move(levels.typical)};
}

}  // namespace cmp::image
