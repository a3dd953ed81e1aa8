// Small triangles of a folded sheet over the samples of a tile.
#include "base/binding.hpp"

#include <cmath>
#include <limits>
#include <optional>

namespace cmp {

namespace {

constexpr std::uint8_t OVERLAPPING = 2;  // sheets over a sample that need a correction

// Triangles in the image.
struct Triangles {
  View<const double, 3> xyd;     // (T, 3, 3) x and y in px, depth in mm
  View<const double, 3> uv;      // (T, 3, 2) the same corners in texels
  View<const double, 1> facing;  // (T,) 1 towards the camera, -1 away
};

// The samples of a square tile.
struct Tile {
  Index left, top, count, samples;  // first pixel, samples along a side, samples per px

  double at(Index start, Index sample) const {
    return static_cast<double>(start) - 0.5 +
           (static_cast<double>(sample) + 0.5) / static_cast<double>(samples);
  }
};

struct Range {
  Index begin, end;
};

struct Box {
  Range rows, columns;
};

struct Barycentric {
  double a, b, c;
};

// Barycentric coordinates of a point in a triangle (3, 3); nothing outside the triangle.
std::optional<Barycentric> barycentric(View<const double, 2> triangle, double x, double y) {
  const double ax = triangle(0, 0) - x, ay = triangle(0, 1) - y, bx = triangle(1, 0) - x,
               by = triangle(1, 1) - y;
  const double cx = triangle(2, 0) - x, cy = triangle(2, 1) - y;
  const double a = bx * cy - by * cx, b = cx * ay - cy * ax, c = ax * by - ay * bx;
  if (!((a > 0 && b > 0 && c > 0) || (a < 0 && b < 0 && c < 0))) return std::nullopt;
  const double total = a + b + c;
  return Barycentric{a / total, b / total, c / total};
}

double interpolated(const Barycentric& place, View<const double, 2> corners, int column) {
  return place.a * corners(0, column) + place.b * corners(1, column) + place.c * corners(2, column);
}

// The samples between the smallest and the largest of a triangle's coordinates along one axis.
Range sample_range(View<const double, 2> triangle, int axis, Index start, const Tile& tile) {
  const double a = triangle(0, axis), b = triangle(1, axis), c = triangle(2, axis);
  const double low = std::min({a, b, c}), high = std::max({a, b, c});
  const auto origin = static_cast<double>(start), samples = static_cast<double>(tile.samples);
  const double first = std::ceil(std::max((low - origin + 0.5) * samples - 0.5, 0.0));
  const double last =
      std::floor(std::min((high - origin + 0.5) * samples - 0.5, static_cast<double>(tile.count) - 1.0));
  return {static_cast<Index>(std::min(first, static_cast<double>(tile.count))), static_cast<Index>(last) + 1};
}

// The number of sheets over each sample; a sheet that faces away counts as OVERLAPPING.
Array<std::uint8_t, 2> count_sheets(const Triangles& triangles, const Tile& tile) {
  Array<std::uint8_t, 2> found({tile.count, tile.count}, 0);
  for (Index t = 0; t < triangles.xyd.size(); ++t) {
    const auto triangle = triangles.xyd[t];
    const Range columns = sample_range(triangle, 0, tile.left, tile),
                rows = sample_range(triangle, 1, tile.top, tile);
    const std::uint8_t more = triangles.facing[t] > 0 ? 1 : OVERLAPPING;
    for (Index j = rows.begin; j < rows.end; ++j)
      for (Index i = columns.begin; i < columns.end; ++i)
        if (found(j, i) < OVERLAPPING && barycentric(triangle, tile.at(tile.left, i), tile.at(tile.top, j)))
          found(j, i) = static_cast<std::uint8_t>(found(j, i) + more);
  }
  return found;
}

// The box of the samples under OVERLAPPING sheets or more; empty without such samples.
Box overlap_box(View<const std::uint8_t, 2> sheets) {
  const Index count = sheets.size();
  Box box{{count, 0}, {count, 0}};
  for (Index j = 0; j < count; ++j) {
    for (Index i = 0; i < count; ++i) {
      if (sheets(j, i) < OVERLAPPING) continue;
      box.rows = {std::min(box.rows.begin, j), std::max(box.rows.end, j + 1)};
      box.columns = {std::min(box.columns.begin, i), std::max(box.columns.end, i + 1)};
    }
  }
  return box;
}

// Writes every plane's value at texel (u, v) into `value`, bilinear between the centres of texels.
void fill_texture_value(View<const float, 3> texture, double u, double v, View<double, 1> value) {
  const Index column = std::clamp<Index>(static_cast<Index>(u), 0, texture.size(2) - 2);
  const Index row = std::clamp<Index>(static_cast<Index>(v), 0, texture.size(1) - 2);
  const double right = u - static_cast<double>(column), down = v - static_cast<double>(row);
  for (Index plane = 0; plane < value.size(); ++plane) {
    const double upper = (1 - right) * texture(plane, row, column) + right * texture(plane, row, column + 1);
    const double lower =
        (1 - right) * texture(plane, row + 1, column) + right * texture(plane, row + 1, column + 1);
    value[plane] = (1 - down) * upper + down * lower;
  }
}

// The correction of the samples of a tile where sheets overlap or one faces away: first row, first column,
// and (planes, rows, columns) the nearest sheet's value less the signed sum of all sheets.
//
// left, top: the tile's first pixel. size: its side in px. samples: samples per px along each axis.
std::tuple<Index, Index, Array<double, 3>> occlusion_residual(View<const double, 3> xyd,
                                                              View<const double, 3> uv,
                                                              View<const double, 1> facing,
                                                              View<const float, 3> texture, Index left,
                                                              Index top, Index size, Index samples) {
  const Triangles triangles{xyd, uv, facing};
  const Tile tile{left, top, size * samples, samples};
  const Array<std::uint8_t, 2> sheets = count_sheets(triangles, tile);
  const Box box = overlap_box(sheets);
  const Index planes = texture.size(), row = box.rows.begin, column = box.columns.begin;
  const Index rows = std::max<Index>(box.rows.end - row, 0),
              columns = std::max<Index>(box.columns.end - column, 0);
  Array<double, 3> result({planes, rows, columns}, 0.0), nearest({planes, rows, columns}, 0.0);
  Array<double, 2> depth({rows, columns}, std::numeric_limits<double>::infinity());
  Array<double, 1> value({planes});
  for (Index t = 0; t < xyd.size() && rows > 0; ++t) {
    const Range x = sample_range(xyd[t], 0, left, tile), y = sample_range(xyd[t], 1, top, tile);
    for (Index j = std::max(y.begin, row); j < std::min(y.end, row + rows); ++j) {
      for (Index i = std::max(x.begin, column); i < std::min(x.end, column + columns); ++i) {
        if (sheets(j, i) < OVERLAPPING) continue;
        const auto place = barycentric(xyd[t], tile.at(left, i), tile.at(top, j));
        if (!place) continue;
        fill_texture_value(texture, interpolated(*place, uv[t], 0), interpolated(*place, uv[t], 1), value);
        const double distance = interpolated(*place, xyd[t], 2);
        double& closest = depth(j - row, i - column);
        for (Index plane = 0; plane < planes; ++plane) {
          result(plane, j - row, i - column) -= facing[t] * value[plane];
          if (distance < closest) nearest(plane, j - row, i - column) = value[plane];
        }
        closest = std::min(closest, distance);
      }
    }
  }
  for (Index k = 0; k < result.count(); ++k) result.flat()[k] += nearest.flat()[k];
  return {row, column, std::move(result)};
}

// (N,) the smallest depth of any triangle at points (N, 3) in ascending order of x; infinity without a
// triangle.
Array<double, 1> nearest_depth(View<const double, 3> xyd, View<const double, 2> points) {
  Array<double, 1> found({points.size()}, std::numeric_limits<double>::infinity()), x({points.size()});
  for (Index n = 0; n < points.size(); ++n) x[n] = points(n, 0);
  for (Index t = 0; t < xyd.size(); ++t) {
    const auto triangle = xyd[t];
    const auto [low_x, high_x] = std::minmax({triangle(0, 0), triangle(1, 0), triangle(2, 0)});
    const auto [low_y, high_y] = std::minmax({triangle(0, 1), triangle(1, 1), triangle(2, 1)});
    for (Index n = std::lower_bound(x.begin(), x.end(), low_x) - x.begin(); n < x.size() && x[n] <= high_x;
         ++n) {
      if (points(n, 1) < low_y || points(n, 1) > high_y) continue;
      if (const auto place = barycentric(triangle, x[n], points(n, 1)))
        found[n] = std::min(found[n], interpolated(*place, triangle, 2));
    }
  }
  return found;
}

}  // namespace

void add_occlusion(nb::module_ module) {
  bind<&occlusion_residual>(module, "occlusion_residual",
                            {"xyd", "uv", "facing", "texture", "left", "top", "size", "samples"});
  bind<&nearest_depth>(module, "nearest_depth", {"xyd", "points"});
}

}  // namespace cmp
