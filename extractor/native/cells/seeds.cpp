#include "cells/seeds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cmp::cells {

namespace {

// Columns of the runs.
constexpr int RUN_Y = 0, RUN_START = 1, RUN_END = 2, RUN_INK = 3;
constexpr double PIXEL_VARIANCE = 1.0 / 12.0;  // a pixel is a square, not a point

// The number of horizontal runs of one ink in label (H, W).
Index count_runs(View<const std::uint8_t, 2> label) {
  Index count = 0;
  for (Index y = 0; y < label.size(0); ++y) {
    const auto row = label[y];
    std::int32_t in_row = row[0] != 0;
    for (Index x = 1; x < label.size(1); ++x) in_row += (row[x] != row[x - 1]) & (row[x] != 0);
    count += in_row;
  }
  return count;
}

// Writes the first columns of a row's stretches of equal label, with or without ink, and at last the row's
// width.
//
// Returns the number of stretches.
Index fill_stretches(View<const std::uint8_t, 1> row, View<std::int32_t, 1> begin) {
  const Index width = row.size();
  Index stretches = 1;
  begin[0] = 0;
  for (Index x = 1; x < width; ++x) {
    begin[stretches] = static_cast<std::int32_t>(x);
    stretches += row[x] != row[x - 1];
  }
  begin[stretches] = static_cast<std::int32_t>(width);
  return stretches;
}

// (R, 4) the horizontal runs of one ink in label (H, W), row by row.
Array<std::int32_t, 2> runs_of_rows(View<const std::uint8_t, 2> label) {
  Array<std::int32_t, 2> found({count_runs(label), 4});
  const auto runs = found.view();
  Array<std::int32_t, 1> buffer({label.size(1) + 1});
  const auto begin = buffer.view();
  Index count = 0;
  for (Index y = 0; y < label.size(0); ++y) {
    const auto row = label[y];
    const Index stretches = fill_stretches(row, begin);
    for (Index n = 0; n < stretches; ++n) {
      const std::int32_t ink = row[begin[n]];
      if (ink == 0) continue;
      runs(count, RUN_Y) = static_cast<std::int32_t>(y);
      runs(count, RUN_START) = begin[n];
      runs(count, RUN_END) = begin[n + 1] - 1;
      runs(count, RUN_INK) = ink;
      ++count;
    }
  }
  return found;
}

// The first run of the domain of run i; halves the path to it in parent (R,).
std::int32_t update_and_find_root(View<std::int32_t, 1> parent, std::int32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

// Runs (R, 4), their domains (R,) and the areas (D,) of these.
struct Domains {
  Array<std::int32_t, 2> runs;
  Array<std::int32_t, 1> domain;
  Array<std::int64_t, 1> area;
};

// All domains of the runs (R, 4) with the parents (R,), except the runs themselves.
Domains numbered_domains(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> parent) {
  const Index count = runs.size();
  Array<std::int32_t, 1> domain({count});
  Array<std::int64_t, 1> area({count}, 0);
  const auto domains = domain.view();
  const auto areas = area.view();
  std::int32_t found = 0;
  for (Index i = 0; i < count; ++i) {
    const bool is_first = parent[i] == i;
    // without a branch, which would be unpredictable
    domains[i] = found;
    const std::int32_t d = domains[parent[i]];
    domains[i] = d;
    found += is_first;
    areas[d] += runs(i, RUN_END) - runs(i, RUN_START) + 1;
  }
  return {{}, std::move(domain), area.first(found)};
}

// The runs of the domains to `keep` (D,), the renumbered domain of each, and the domains' areas.
Domains selected_domains(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                         View<const std::int64_t, 1> area, View<const bool, 1> keep) {
  Array<std::int32_t, 1> number({area.size()});
  std::int32_t few = 0;
  for (Index d = 0; d < area.size(); ++d) {
    number[d] = few;
    few += keep[d];
  }
  Array<std::int64_t, 1> kept_area({few});
  for (Index d = 0; d < area.size(); ++d)
    if (keep[d]) kept_area[number[d]] = area[d];
  Index own = 0;
  for (Index i = 0; i < domain.size(); ++i) own += keep[domain[i]];
  Array<std::int32_t, 2> some({own + 1, 4});
  Array<std::int32_t, 1> of({own + 1});
  own = 0;
  for (Index i = 0; i < domain.size(); ++i) {
    const std::int32_t d = domain[i];
    // a run not kept is overwritten: a branch would be unpredictable
    for (int column = 0; column < 4; ++column) some(own, column) = runs(i, column);
    of[own] = number[d];
    own += keep[d];
  }
  return {some.first(own), of.first(own), std::move(kept_area)};
}

// (D,) px^2, the root of the determinant of the covariance of each domain's pixels.
Array<double, 1> covariance_root(const Domains& domains) {
  const auto runs = domains.runs.view();
  const auto domain = domains.domain.view();
  const auto area = domains.area.view();
  Array<double, 2> sums({area.size(), 5}, 0.0);
  for (Index i = 0; i < domain.size(); ++i) {
    const auto sum = sums[domain[i]];
    const std::int64_t whole_length = runs(i, RUN_END) - runs(i, RUN_START) + 1;
    const auto length = static_cast<double>(whole_length);
    const auto y = static_cast<double>(runs(i, RUN_Y));
    const double x = 0.5 * static_cast<double>(runs(i, RUN_START) + runs(i, RUN_END));
    sum[0] += length * x;
    sum[1] += length * y;
    sum[2] += length * (x * x + static_cast<double>(whole_length * whole_length - 1) / 12.0);
    sum[3] += length * x * y;
    sum[4] += length * y * y;
  }
  Array<double, 1> out({area.size()});
  for (Index d = 0; d < area.size(); ++d) {
    const auto n = static_cast<double>(area[d]);
    const double x = sums(d, 0) / n, y = sums(d, 1) / n;
    const double xx = sums(d, 2) / n - x * x + PIXEL_VARIANCE, yy = sums(d, 4) / n - y * y + PIXEL_VARIANCE;
    const double xy = sums(d, 3) / n - x * y;
    out[d] = std::sqrt(std::max(xx * yy - xy * xy, 0.0));
  }
  return out;
}

// Runs (R, 4) of one ink: y, first x, last x, ink; and (R,) an earlier run of the domain of each run, or
// itself.
struct FoundRuns {
  Array<std::int32_t, 2> runs;
  Array<std::int32_t, 1> parent;
};

// The horizontal runs of one ink, connected with the adjacent runs of their ink in the row above
// (4-neighbours).
FoundRuns find_runs(View<const std::uint8_t, 2> label) {
  auto found = runs_of_rows(label);
  const auto runs = found.view();
  const auto count = static_cast<std::int32_t>(found.size());
  Array<std::int32_t, 1> parents({count});
  const auto parent = parents.view();
  for (std::int32_t i = 0; i < count; ++i) parent[i] = i;
  std::int32_t above = 0;
  for (std::int32_t i = 0; i < count; ++i) {
    const std::int32_t before = runs(i, RUN_Y) - 1, start = runs(i, RUN_START), end = runs(i, RUN_END);
    const std::int32_t ink = runs(i, RUN_INK);
    while (runs(above, RUN_Y) < before || (runs(above, RUN_Y) == before && runs(above, RUN_END) < start))
      ++above;
    std::int32_t own = i;
    for (std::int32_t other = above; runs(other, RUN_Y) == before && runs(other, RUN_START) <= end; ++other) {
      if (runs(other, RUN_INK) != ink) continue;
      if (own == i) {
        own = parent[other];
      } else if (own != parent[other]) {
        const std::int32_t a = update_and_find_root(parent, own), b = update_and_find_root(parent, other);
        parent[std::max(a, b)] = std::min(a, b);
      }
    }
    parent[i] = own;
  }
  return {std::move(found), std::move(parents)};
}

}  // namespace

FoundDomains find_domains(View<const std::uint8_t, 2> label, Index max_domains, const DomainLimits& limits) {
  FoundRuns found = find_runs(label);
  const View<const std::int32_t, 2> runs = found.runs;
  auto all = numbered_domains(runs, found.parent);
  const Index count = all.area.size();
  Index large = 0;
  for (Index d = 0; d < count; ++d) large += all.area[d] >= limits.min_domain_px;
  const bool is_cluttered = large > max_domains;
  const std::int64_t least = is_cluttered ? limits.min_cluttered_px : limits.min_domain_px;
  Array<bool, 1> keep({count});
  bool all_kept = true;
  for (Index d = 0; d < count; ++d) {
    keep[d] = all.area[d] >= least;
    all_kept = all_kept && keep[d];
  }
  if (all_kept) {
    all.runs = std::move(found.runs);
  } else {
    all = selected_domains(runs, all.domain, all.area, keep);
  }
  if (is_cluttered) {
    const auto root = covariance_root(all);
    Array<bool, 1> solid({root.size()});
    for (Index d = 0; d < root.size(); ++d)
      solid[d] = static_cast<double>(all.area[d]) >= limits.min_solidity * root[d];
    all = selected_domains(all.runs, all.domain, all.area, solid);
  }
  const Index kept = all.area.size();
  const Index small = std::count_if(all.area.begin(), all.area.end(),
                                    [&](std::int64_t area) { return area < limits.safe_area_px; });
  const bool has_large_domains =
      static_cast<double>(small) < limits.max_small_share * static_cast<double>(kept);
  return {std::move(all.area), std::move(all.runs), std::move(all.domain), is_cluttered, has_large_domains};
}

SeedPoints seed_points(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                       View<const std::int64_t, 1> area) {
  const Index count = area.size();
  Array<std::uint8_t, 1> ink({count});
  Array<double, 2> center({count, 2}, 0.0);
  for (Index i = 0; i < runs.size(); ++i) {
    const std::int32_t d = domain[i];
    const std::int64_t length = runs(i, RUN_END) - runs(i, RUN_START) + 1;
    ink[d] = static_cast<std::uint8_t>(runs(i, RUN_INK));
    center(d, 0) +=
        0.5 * static_cast<double>(length) * static_cast<double>(runs(i, RUN_START) + runs(i, RUN_END));
    center(d, 1) += static_cast<double>(length * runs(i, RUN_Y));
  }
  Array<std::int32_t, 1> middle({count});
  Array<double, 1> best({count}, std::numeric_limits<double>::infinity());
  for (Index d = 0; d < count; ++d) {
    center(d, 0) /= static_cast<double>(area[d]);
    center(d, 1) /= static_cast<double>(area[d]);
    middle[d] = static_cast<std::int32_t>(std::nearbyint(center(d, 0)));
  }
  Array<std::int32_t, 2> xy({count, 2}, 0);
  for (Index i = 0; i < runs.size(); ++i) {
    const std::int32_t d = domain[i];
    const std::int32_t x = std::min(std::max(middle[d], runs(i, RUN_START)), runs(i, RUN_END));
    const double dx = x - center(d, 0), dy = runs(i, RUN_Y) - center(d, 1);
    const double distance = dx * dx + dy * dy;
    if (distance < best[d]) {
      best[d] = distance;
      xy(d, 0) = x;
      xy(d, 1) = runs(i, RUN_Y);
    }
  }
  return {std::move(xy), std::move(center), std::move(ink)};
}

Array<double, 2> domain_moments(View<const std::int32_t, 2> runs, View<const std::int32_t, 1> domain,
                                View<const std::int32_t, 2> seed_xy) {
  Array<double, 2> moments({seed_xy.size(), MOMENT_TERMS}, 0.0);
  for (Index i = 0; i < runs.size(); ++i) {
    const std::int32_t d = domain[i];
    const double y = runs(i, RUN_Y) - seed_xy(d, 1), length = runs(i, RUN_END) - runs(i, RUN_START) + 1;
    const double middle = 0.5 * (runs(i, RUN_START) + runs(i, RUN_END)) - seed_xy(d, 0);
    const double spread = length * (length * length - 1.0) / 12.0;  // sum of squares about the middle
    const double x = length * middle, xx = x * middle + spread;
    const auto out = moments[d];
    out[0] += length;
    out[1] += x;
    out[2] += length * y;
    out[3] += xx;
    out[4] += x * y;
    out[5] += length * y * y;
    out[6] += middle * (x * middle + 3.0 * spread);
    out[7] += xx * y;
    out[8] += x * y * y;
    out[9] += length * y * y * y;
  }
  return moments;
}

}  // namespace cmp::cells
