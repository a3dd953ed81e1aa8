#include "refine/measure/gridline_offsets.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "numeric/median.hpp"
#include "refine/measure/matched_filter.hpp"
#include "refine/measure/station_pixels.hpp"
#include "refine/synthesis/gridline_sides.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/pixel_rows.hpp"

namespace cmp::refine {

namespace {

constexpr Index OFFSET = 0, VARIANCE = 1, COLORS = 3;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

// Memory for the pixels of one gridline.
struct OffsetBuffers {
  BlockRows rows;
  Residuals residuals;
  StationPixels pixels;
};

// The sums at a station: of the weighted residuals, and of the information.
struct StationTotal {
  double residual, information;
};

// The gridlines that are measured, and what they are compared with.
struct Comparison {
  ComparedImages images;
  Index width, height;
  GridlineReading reading;
  double band;  // in units of the blur
};

// Fills in the sums at the stations of gridline e.
void fill_station_sums(const Comparison& compared, Index e, OffsetBuffers& buffers,
                       std::vector<StationTotal>& sums) {
  const GridlineReading& reading = compared.reading;
  const SideLight light = side_light(reading.sides, reading.added, e);
  const RowFrame frame = row_frame(reading.lines, e, {0, 0, compared.width, compared.height}, compared.width);
  const PixelGeometry line = pixel_geometry(frame, reading.sigma);
  const double reach = compared.band * reading.sigma, intervals = static_cast<double>(sums.size()) + 1.0;
  // the pixels of the first and of the last station reach half an interval beyond these
  const double from_p = frame.p + (0.5 / intervals) * frame.length * frame.up;
  const double to_p = frame.p + (1.0 - 0.5 / intervals) * frame.length * frame.up;
  const double slack = reach * std::abs(frame.uq), half = reach / std::abs(frame.up);
  const auto begin = std::max<Index>(static_cast<Index>(std::ceil(std::min(from_p, to_p) - slack)), 0);
  const Index last =
      std::min(static_cast<Index>(std::floor(std::max(from_p, to_p) + slack)), frame.p_count - 1);
  const auto [wide, most] = row_sizes(half, frame.q_count);
  std::fill(sums.begin(), sums.end(), StationTotal{0.0, 0.0});
  for (Index first = begin; first <= last; first += most) {
    const RowBlock block{std::min(most, last + 1 - first), wide, frame.step_q};
    fill_rows(block, first, frame, half, buffers.rows);
    fill_stations(buffers.rows, block, line, static_cast<float>(intervals), static_cast<float>(compared.band),
                  buffers.pixels);
    fill_residuals(compared.images, block, buffers.rows, light, buffers.pixels.before_share,
                   buffers.residuals);
    for (std::size_t j = 0; j < sums.size(); ++j) {
      const auto own =
          sums_at_station(buffers.pixels, buffers.residuals, block.pixels(), static_cast<float>(j));
      sums[j].residual += own.residual;
      sums[j].information += own.information;
    }
  }
}

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

Array<double, 3> measure_offsets(const image::PyramidLevel& view, View<const float, 3> model,
                                 const GridlineReading& reading, Index count, const OffsetLimits& limits) {
  const View<const double, 2> lines = reading.lines;
  const auto contrasts = value_contrasts(reading.sides, view.response.encoded);
  const Comparison compared{{view.image.flat(), model.flat(), view.response.encoded},
                            view.image.size(1),
                            view.image.size(0),
                            reading,
                            limits.band};
  Array<double, 3> out({lines.size(), count, 2}, NONE);
  // every pixel that is read is written before, but those of lanes without a row
  const auto buffers = std::make_unique<OffsetBuffers>();
  std::vector<StationTotal> sums(static_cast<std::size_t>(count));
  for (Index e = 0; e < lines.size(); ++e) {
    const auto contrast = contrasts[e];
    const double strength = contrast[0] * contrast[0] + contrast[1] * contrast[1] + contrast[2] * contrast[2];
    if (lines(e, KNOWN) == 0.0 || strength == 0.0 || reading.weight[e] < limits.min_offset_weight) continue;
    fill_station_sums(compared, e, *buffers, sums);
    for (Index j = 0; j < count; ++j) {
      const auto [residual, information] = sums[static_cast<std::size_t>(j)];
      if (information < limits.min_weight_sum * strength) continue;
      const double variance = reading.variance_ratio[e] * (reading.noise * reading.noise);
      out(e, j, OFFSET) = reading.sigma * residual / information - reading.dot_gain_offset[e];
      out(e, j, VARIANCE) = variance * (reading.sigma * reading.sigma) / information;
    }
  }
  update_without_profiles(out, contrasts, limits);
  return out;
}

Array<double, 3> virtual_markers(View<const double, 2> lines, View<const double, 3> offsets, double scale) {
  const Index edges = offsets.size(), count = offsets.size(1);
  Array<double, 3> out({edges, count, 3});
  for (Index e = 0; e < edges; ++e) {
    const auto line = lines[e];
    const double ux = line[UX], uy = line[UY], length = line[LENGTH];
    for (Index j = 0; j < count; ++j) {
      const double t = (static_cast<double>(j) + 1.0) / (static_cast<double>(count) + 1.0);
      const double off = sagitta(t, length, line[LEAVE], line[ARRIVE]) + offsets(e, j, OFFSET);
      out(e, j, 0) = (line[X] + t * length * ux - off * uy + 0.5) * scale - 0.5;
      out(e, j, 1) = (line[Y] + t * length * uy + off * ux + 0.5) * scale - 0.5;
      out(e, j, 2) = offsets(e, j, VARIANCE) * scale * scale;
    }
  }
  return out;
}

}  // namespace cmp::refine
