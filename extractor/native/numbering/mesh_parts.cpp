#include "numbering/mesh_parts.hpp"

#include <cmath>
#include <limits>
#include <numeric>

#include "numbering/plane_point.hpp"
#include "numeric/bilinear.hpp"
#include "numeric/median.hpp"

namespace cmp::numbering {

namespace {

// The middle of a face's cells.
PlanePoint face_middle(View<const double, 2> center, View<const std::int32_t, 1> face) {
  PlanePoint middle{0.0, 0.0};
  for (int k = 0; k < 3; ++k) {
    middle.x += center(face[k], 0) / 3;
    middle.y += center(face[k], 1) / 3;
  }
  return middle;
}

// The numbers of faces of each component.
Array<std::int64_t, 1> component_sizes(View<const std::int32_t, 1> part) {
  std::int32_t last = -1;
  for (const std::int32_t i : part) last = std::max(last, i);
  Array<std::int64_t, 1> sizes({last + 1}, 0);
  for (const std::int32_t i : part)
    if (i >= 0) ++sizes[i];
  return sizes;
}

}  // namespace

Array<std::int32_t, 1> connected_components(View<const std::int32_t, 2> neighbours,
                                            View<const bool, 1> member) {
  const Index size = member.size(), columns = neighbours.size(1);
  Array<std::int32_t, 1> parts({size}, -1), waiting({size});
  const auto part = parts.view(), stack = waiting.view();
  std::int32_t count = 0;
  for (Index first = 0; first < size; ++first) {
    if (!member[first] || part[first] >= 0) continue;
    part[first] = count;
    stack[0] = static_cast<std::int32_t>(first);
    Index height = 1;
    while (height > 0) {
      const auto row = neighbours[stack[--height]];
      for (Index k = 0; k < columns; ++k) {
        const std::int32_t j = row[k];
        if (j >= 0 && member[j] && part[j] < 0) {
          part[j] = count;
          stack[height++] = j;
        }
      }
    }
    ++count;
  }
  return parts;
}

std::tuple<Array<std::int64_t, 1>, Array<std::int64_t, 1>> faces_by_component(
    View<const std::int32_t, 2> neighbours, View<const std::int8_t, 1> orientation) {
  Array<bool, 1> is_face({orientation.size()});
  for (Index f = 0; f < orientation.size(); ++f) is_face[f] = orientation[f] != 0;
  const auto part = connected_components(neighbours, is_face);
  const auto sizes = component_sizes(part);
  const Index count = sizes.size();
  Array<Index, 1> largest({count});
  std::iota(largest.begin(), largest.end(), Index{0});
  std::stable_sort(largest.begin(), largest.end(), [&](Index a, Index b) { return sizes[a] > sizes[b]; });
  Array<std::int64_t, 1> begin({count + 1}), filled({count});
  begin[0] = 0;
  for (Index k = 0; k < count; ++k) {
    filled[largest[k]] = begin[k];
    begin[k + 1] = begin[k] + sizes[largest[k]];
  }
  Array<std::int64_t, 1> faces({begin[count]});
  for (Index f = 0; f < part.size(); ++f)
    if (part[f] >= 0) faces[filled[part[f]]++] = f;
  return {std::move(faces), std::move(begin)};
}

std::int64_t most_central_face(View<const double, 2> center, View<const std::int32_t, 2> faces,
                               View<const std::int64_t, 1> members, View<const bool, 1> blocked) {
  double x = 0.0, y = 0.0;
  for (const std::int64_t f : members)
    for (int k = 0; k < 3; ++k) {
      x += center(faces(f, k), 0);
      y += center(faces(f, k), 1);
    }
  // three times the mean, as below
  x /= static_cast<double>(members.size());
  y /= static_cast<double>(members.size());
  std::int64_t best = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (const std::int64_t f : members) {
    const std::int32_t a = faces(f, 0), b = faces(f, 1), c = faces(f, 2);
    if (blocked[a] || blocked[b] || blocked[c]) continue;
    const double dx = center(a, 0) + center(b, 0) + center(c, 0) - x;
    const double dy = center(a, 1) + center(b, 1) + center(c, 1) - y;
    if (dx * dx + dy * dy < nearest) {
      best = f;
      nearest = dx * dx + dy * dy;
    }
  }
  return best;
}

int marker_turn_by_brightness(View<const std::uint8_t, 3> image, View<const double, 2> center,
                              View<const std::int32_t, 2> faces, View<const std::int8_t, 1> orientation,
                              const MarkerTurnLimits& limits) {
  const auto flat = image.flat();
  const Index height = image.size(0), width = image.size(1);
  const Index face_count =
      orientation.size() - std::count(orientation.begin(), orientation.end(), std::int8_t{0});
  const Index every = std::max<Index>(1, face_count / limits.max_sampled_faces);
  Array<double, 2> brightness({2, orientation.size() / every + 1});
  Array<double, 1> color({3}, 0.0);
  std::array<Index, 2> count{0, 0};
  Index number_of = 0;
  for (Index f = 0; f < orientation.size(); ++f) {
    if (orientation[f] == 0) continue;
    if (++number_of % every != 0) continue;
    const auto [x, y] = face_middle(center, faces[f]);
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k)
      nearest = std::min(nearest, std::hypot(center(faces(f, k), 0) - x, center(faces(f, k), 1) - y));
    if (numeric::fill_patch_mean(flat, height, width, x, y, limits.sample_radius * nearest, color)) {
      const int side = orientation[f] > 0 ? 1 : 0;
      brightness(side, count[side]++) = color[0] + color[1] + color[2];
    }
  }
  if (std::min(count[0], count[1]) < limits.min_sampled_faces) return 0;
  const double clockwise = numeric::median_of_many(brightness[1].slice(0, count[1]));
  return clockwise > numeric::median_of_many(brightness[0].slice(0, count[0])) ? 1 : -1;
}

}  // namespace cmp::numbering
