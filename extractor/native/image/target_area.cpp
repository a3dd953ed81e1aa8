#include "image/target_area.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace cmp::image {

namespace {

// The mask with a value also in the eight tiles around each tile that has the value.
Array<std::uint8_t, 2> dilated(View<const std::uint8_t, 2> mask, std::uint8_t value) {
  const auto rows = mask.size(0), columns = mask.size(1);
  Array<std::uint8_t, 2> out(mask);
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      if (mask(row, column) != value) continue;
      const Index left = std::max<Index>(column - 1, 0), right = std::min(column + 2, columns);
      for (Index y = std::max<Index>(row - 1, 0); y < std::min(row + 2, rows); ++y)
        out[y].slice(left, right).fill(value);
    }
  }
  return out;
}

// 1 for tiles outside the barrier that are 4-connected to the image's border.
Array<std::uint8_t, 2> flooded(View<const std::uint8_t, 2> barrier) {
  const auto rows = barrier.size(0), columns = barrier.size(1);
  Array<std::uint8_t, 2> filled({rows, columns}, 0);
  std::vector<std::array<Index, 2>> stack;
  const auto push_free = [&](Index row, Index column) {
    if (row < 0 || column < 0 || row == rows || column == columns) return;
    if (barrier(row, column) != 0 || filled(row, column) != 0) return;
    filled(row, column) = 1;
    stack.push_back({row, column});
  };
  for (Index row = 0; row < rows; ++row) {
    push_free(row, 0);
    push_free(row, columns - 1);
  }
  for (Index column = 0; column < columns; ++column) {
    push_free(0, column);
    push_free(rows - 1, column);
  }
  while (!stack.empty()) {
    const auto [row, column] = stack.back();
    stack.pop_back();
    push_free(row, column + 1);
    push_free(row + 1, column);
    push_free(row, column - 1);
    push_free(row - 1, column);
  }
  return filled;
}

}  // namespace

Array<std::uint8_t, 2> tile_chroma(View<const std::uint8_t, 2> chroma, Index tile_px) {
  const auto height = chroma.size(0), width = chroma.size(1);
  const Index rows = (height + tile_px - 1) / tile_px, columns = (width + tile_px - 1) / tile_px;
  Array<std::uint8_t, 2> largest({rows, columns});
  Array<std::uint8_t, 1> buffer({width});
  const auto strongest = buffer.view();
  for (Index row = 0; row < rows; ++row) {
    strongest.fill(0);
    for (Index y = row * tile_px; y < std::min((row + 1) * tile_px, height); ++y) {
      const auto levels = chroma[y];
      for (Index x = 0; x < width; ++x) strongest[x] = std::max(strongest[x], levels[x]);
    }
    for (Index column = 0; column < columns; ++column) {
      std::uint8_t tile_max = 0;
      for (std::uint8_t one : strongest.slice(column * tile_px, std::min((column + 1) * tile_px, width)))
        tile_max = std::max(tile_max, one);
      largest(row, column) = tile_max;
    }
  }
  return largest;
}

Array<std::uint8_t, 2> target_mask(View<const std::uint8_t, 2> chroma, const TargetLimits& limits) {
  const auto rows = chroma.size(0), columns = chroma.size(1);
  std::array<std::int64_t, 256> counts{};
  for (Index row = 0; row < rows; ++row)
    for (std::uint8_t level : chroma[row]) ++counts[level];
  const auto rank = static_cast<Index>(limits.strong_quantile * static_cast<double>(rows * columns - 1));
  std::int64_t below = counts[0];
  Index strong = 0;
  while (below <= rank) below += counts[++strong];
  const double limit =
      std::max(static_cast<double>(limits.min_chroma), limits.strong_share * static_cast<double>(strong));
  Array<std::uint8_t, 2> colored({rows, columns});
  for (Index row = 0; row < rows; ++row)
    for (Index column = 0; column < columns; ++column)
      colored(row, column) = chroma(row, column) > limit ? 1 : 0;
  Array<std::uint8_t, 2> mask = flooded(dilated(dilated(colored, 1), 0));
  for (std::uint8_t& one : mask.flat()) one = 1 - one;
  return mask;
}

}  // namespace cmp::image
