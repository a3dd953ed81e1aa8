#include "complete/image_quality.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "numeric/bilinear_batch.hpp"
#include "numeric/median.hpp"

namespace cmp::complete {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr Index INKS = 3, COLORS = 4, BLACK = 3, CHANNELS = 3;
constexpr double LARGEST_LIGHT = 255.0;
// From linear sRGB to XYZ, relative to the white D65 (IEC 61966-2-1), and the limits of L*a*b* (CIE 15).
constexpr double WHITE_X = 0.9505, WHITE_Z = 1.0890;
constexpr std::array<std::array<double, CHANNELS>, 3> XYZ_OF_RGB{
    {{0.4124 / WHITE_X, 0.3576 / WHITE_X, 0.1805 / WHITE_X},
     {0.2126, 0.7152, 0.0722},
     {0.0193 / WHITE_Z, 0.1192 / WHITE_Z, 0.9505 / WHITE_Z}}};
constexpr double LAB_STRAIGHT = 0.008856451679035631;  // (6 / 29)^3
constexpr double LAB_SLOPE = 7.787037037037035;        // (29 / 6)^2 / 3
constexpr double LAB_OFFSET = 4.0 / 29.0;

using Lights = std::array<double, CHANNELS>;  // BGR

double sum(const Lights& light) { return light[0] + light[1] + light[2]; }

// The light of a value between two entries of the table.
double light_of(double value, View<const float, 1> light) {
  const auto below = std::min<Index>(static_cast<Index>(value), 254);
  return light[below] + (value - static_cast<double>(below)) * (light[below + 1] - light[below]);
}

// L*, a*, b* of light, 0 to 255.
std::array<double, 3> lab_of(const Lights& bgr) {
  std::array<double, 3> f;
  for (Index k = 0; k < 3; ++k) {
    double ratio = 0.0;
    for (Index channel = 0; channel < CHANNELS; ++channel)
      ratio += XYZ_OF_RGB[k][channel] * bgr[CHANNELS - 1 - channel] / LARGEST_LIGHT;
    f[k] = ratio > LAB_STRAIGHT ? std::cbrt(ratio) : LAB_SLOPE * ratio + LAB_OFFSET;
  }
  return {116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])};
}

// The least CIE76 difference of two inks, NaN where unknown, and which these are.
struct Contrast {
  double difference = NOT_A_NUMBER;
  Index one = 0, other = 0;
};

// The contrast of the inks by their light.
Contrast least_contrast(const std::array<Lights, COLORS>& median) {
  std::array<std::array<double, 3>, COLORS> lab;
  std::transform(median.begin(), median.end(), lab.begin(), lab_of);
  Contrast out;
  for (Index a = 0; a < COLORS; ++a) {
    for (Index b = 0; b < a; ++b) {
      const double dl = lab[a][0] - lab[b][0], da = lab[a][1] - lab[b][1], db = lab[a][2] - lab[b][2];
      const double difference = std::sqrt(dl * dl + da * da + db * db);
      if (difference < out.difference || (std::isnan(out.difference) && !std::isnan(difference)))
        out = {difference, b, a};
    }
  }
  return out;
}

// The values (4, 3, K) of the cells of each color, and how many there are.
struct CellValues {
  Array<double, 3> values;
  std::array<Index, COLORS> count{};
  Index clipped = 0;  // colored cells

  CellValues(View<const std::uint8_t, 3> image, View<const double, 2> centre,
             View<const std::uint8_t, 1> color, double radius, double clipped_value)
      : values({COLORS, CHANNELS, centre.size()}) {
    Array<numeric::Patch, 1> patches({centre.size()});
    for (Index i = 0; i < centre.size(); ++i) patches[i] = {centre(i, 0), centre(i, 1), radius};
    const Array<double, 2> means = numeric::patch_means(image, patches);
    for (Index i = 0; i < centre.size(); ++i)
      if (means(i, 3) > 0.0) add(means[i], color[i], clipped_value);
  }

  void add(View<const double, 1> own, Index k, double clipped_value) {
    const Index place = count[k]++;
    double largest = 0.0;
    for (Index channel = 0; channel < CHANNELS; ++channel) {
      const double value = own[channel];
      values(k, channel, place) = value;
      largest = std::max(largest, value);
    }
    clipped += k < INKS && largest >= clipped_value ? 1 : 0;
  }

  Index colored() const { return count[0] + count[1] + count[2]; }

  // of each color and channel, NaN without cells
  std::array<Lights, COLORS> median_light(View<const float, 1> light) const {
    std::array<Lights, COLORS> median;
    for (Index k = 0; k < COLORS; ++k) {
      for (Index channel = 0; channel < CHANNELS; ++channel) {
        const auto own = values[k][channel];
        median[k][channel] = count[k] > 0 ? light_of(numeric::median_of(own, count[k]), light) : NOT_A_NUMBER;
      }
    }
    return median;
  }
};

// The light of the dimmest colored cells over that of the brightest; black is subtracted where it was
// measured.
double evenness(const CellValues& cells, const std::array<Lights, COLORS>& median, View<const float, 1> light,
                double dim_quantile) {
  std::vector<double> ratio;
  const double black = cells.count[BLACK] > 0 ? sum(median[BLACK]) : 0.0;
  for (Index k = 0; k < INKS; ++k) {
    const double usual = sum(median[k]) - black;
    if (!(usual > 0.0)) continue;
    for (Index i = 0; i < cells.count[k]; ++i) {
      double total = -black;
      for (Index channel = 0; channel < CHANNELS; ++channel)
        total += light_of(cells.values(k, channel, i), light);
      ratio.push_back(std::max(total, 0.0) / usual);
    }
  }
  if (ratio.empty()) return NOT_A_NUMBER;
  std::sort(ratio.begin(), ratio.end());
  const std::size_t end = ratio.size() - 1;
  const auto last = static_cast<std::size_t>(dim_quantile * static_cast<double>(end) + 0.5);
  const double brightest = ratio[end - last];
  return brightest > 0.0 ? ratio[last] / brightest : NOT_A_NUMBER;
}

// (K, 2) the means of the markers (M, 2) at the corners (K, 3).
Array<double, 2> centres(View<const double, 2> xy, View<const std::int32_t, 2> corners) {
  Array<double, 2> out({corners.size(), 2});
  for (Index i = 0; i < corners.size(); ++i) {
    const Index a = corners(i, 0), b = corners(i, 1), c = corners(i, 2);
    for (Index axis = 0; axis < 2; ++axis) out(i, axis) = (xy(a, axis) + xy(b, axis) + xy(c, axis)) / 3.0;
  }
  return out;
}

// Contrast, the two inks that differ least, clipping and evenness at the middles of cells (K, 2) px; NaN
// where unknown.
CellFigures measure_cells(const image::PyramidLevel& view, View<const double, 2> centre,
                          View<const std::uint8_t, 1> color, double edge_px, const QualityLimits& limits) {
  const auto light = view.response.light;
  const CellValues cells(view.image, centre, color, limits.sample_radius * edge_px, limits.clipped_value);
  if (cells.colored() == 0) return {NOT_A_NUMBER, 0, 0, NOT_A_NUMBER, NOT_A_NUMBER};
  const auto median = cells.median_light(light);
  const auto [contrast, one, other] = least_contrast(median);
  const double clipping = static_cast<double>(cells.clipped) / static_cast<double>(cells.colored());
  return {contrast, one, other, clipping, evenness(cells, median, light, limits.dim_quantile)};
}

}  // namespace

std::tuple<CellFigures, double, double> measure_numbered(const image::PyramidLevel& view,
                                                         const SampledCells& cells, View<const double, 2> xy,
                                                         View<const std::int32_t, 2> edges,
                                                         const QualityLimits& limits) {
  const double edge_px = refine::median_edge(xy, edges, limits.gridlines);
  const double noise = image::estimate_noise(view.image, xy, cells.corners, limits.noise);
  const Array<double, 2> centre = centres(xy, cells.corners);
  return {measure_cells(view, centre, cells.color, edge_px, limits), noise, edge_px};
}

}  // namespace cmp::complete
