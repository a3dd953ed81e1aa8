#include "refine/measure/gridline_offsets.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "numeric/median.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/station_sums.hpp"

namespace cmp::refine {

namespace {

constexpr Index OFFSET = 0, VARIANCE = 1, COLORS = 3;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

// The color in which gridline e has the largest contrast (3,), and 1 or -1 by the side that is brighter.
struct InkSide {
  Index color;
  double outward;

  explicit InkSide(View<const double, 1> contrast) : color(0) {
    for (Index k = 1; k < COLORS; ++k) {
      if (std::abs(contrast[k]) > std::abs(contrast[color])) color = k;
    }
    outward = contrast[0] + contrast[1] + contrast[2] > 0.0 ? 1.0 : -1.0;
  }
};

// Removes from the offsets (E, count, 2) the median outward offset of all gridlines of an ink at each
// station.
void update_without_profiles(View<double, 3> offsets, View<const double, 2> contrasts,
                             const OffsetLimits& limits) {
  const Index edges = offsets.size();
  std::vector<InkSide> sides;
  sides.reserve(static_cast<std::size_t>(edges));
  for (Index e = 0; e < edges; ++e) sides.emplace_back(contrasts[e]);
  const auto outward = [&](Index e) { return sides[static_cast<std::size_t>(e)].outward; };
  Array<double, 1> known({edges});
  Array<std::int64_t, 1> numbers({edges});
  for (Index color = 0; color < COLORS; ++color) {
    Index of_color = 0;
    for (Index e = 0; e < edges; ++e) {
      numbers[of_color] = e;
      of_color += sides[static_cast<std::size_t>(e)].color == color ? 1 : 0;
    }
    const auto gridlines = numbers.slice(0, of_color);
    for (Index j = 0; j < offsets.size(1); ++j) {
      Index count = 0;
      for (const Index e : gridlines) {
        known[count] = outward(e) * offsets(e, j, OFFSET);
        count += std::isnan(known[count]) ? 0 : 1;
      }
      if (count <= limits.min_profile_gridlines) continue;
      const double profile = numeric::median_of_many(known.slice(0, count));
      for (const Index e : gridlines) offsets(e, j, OFFSET) -= outward(e) * profile;
    }
  }
}

}  // namespace

Array<double, 3> measure_offsets(const GridlineReading& reading, const OffsetLimits& limits) {
  const View<const double, 2> lines = reading.lines;
  const auto sums = reading.station_sums;
  const auto contrasts = reading.contrasts;
  Array<double, 3> out({lines.size(), sums.size(1), 2}, NONE);
  for (Index e = 0; e < lines.size(); ++e) {
    const auto contrast = contrasts[e];
    const double strength = contrast[0] * contrast[0] + contrast[1] * contrast[1] + contrast[2] * contrast[2];
    if (lines(e, KNOWN) == 0.0 || strength == 0.0 || reading.weight[e] < limits.min_offset_weight) continue;
    for (Index j = 0; j < sums.size(1); ++j) {
      const double information = sums(e, j, STATION_INFORMATION);
      if (information < limits.min_weight_sum * strength) continue;
      const double variance = reading.variance_ratio[e] * (reading.noise * reading.noise);
      out(e, j, OFFSET) =
          reading.sigma * sums(e, j, STATION_RESIDUAL) / information - reading.dot_gain_offset[e];
      out(e, j, VARIANCE) = variance * (reading.sigma * reading.sigma) / information;
    }
  }
  update_without_profiles(out, contrasts, limits);
  return out;
}

Array<double, 3> virtual_markers(const GridlineReading& reading, double scale, const OffsetLimits& limits) {
  const auto lines = reading.lines;
  const Array<double, 3> offsets = measure_offsets(reading, limits);
  const Index edges = offsets.size(), count = offsets.size(1);
  Array<double, 3> out({edges, count, 3});
  for (Index e = 0; e < edges; ++e) {
    const auto line = lines[e];
    const double ux = line[UX], uy = line[UY], length = line[LENGTH];
    for (Index j = 0; j < count; ++j) {
      const double t = (static_cast<double>(j) + 1.0) / (static_cast<double>(count) + 1.0);
      const double off =
          sagitta(t, length, line[LEAVE], line[ARRIVE]) + offsets(e, j, OFFSET) - reading.ink_offset[e];
      out(e, j, 0) = (line[X] + t * length * ux - off * uy + 0.5) * scale - 0.5;
      out(e, j, 1) = (line[Y] + t * length * uy + off * ux + 0.5) * scale - 0.5;
      out(e, j, 2) = (offsets(e, j, VARIANCE) + reading.ink_variance[e]) * scale * scale;
    }
  }
  return out;
}

}  // namespace cmp::refine
