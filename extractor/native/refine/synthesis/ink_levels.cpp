#include "refine/synthesis/ink_levels.hpp"

#include <cmath>

#include "base/parts.hpp"
#include "image/response.hpp"
#include "numeric/median.hpp"

namespace cmp::refine {

namespace {

constexpr double WHITE_VARIANCE = 1e9;  // the white cell, one only, keeps its own level
constexpr double TINY = 1e-9;           // keeps a division finite

// The inks as polynomials over the image.
struct InkPolynomials {
  Array<double, 3> coefficients;      // (5, 3, 10) by ink and channel
  std::array<double, INKS> variance;  // light^2, of the cells about the polynomials beyond noise
  std::array<double, INKS> noise;     // light, root mean square of the channels, of a pixel
};

// The cells of an ink that lie in the image.
struct InkSamples {
  Array<double, 2> terms;          // (10, n)
  Array<double, 2> values;         // (4, n)
  Array<std::int64_t, 1> numbers;  // (n,) the cells
};

// The derivative of a polynomial (10,) less another one by x (axis 0) or y at (x, y).
double difference_slope(View<const double, 1> f, View<const double, 1> b, double x, double y, int axis) {
  double d = f[1 + axis] - b[1 + axis];
  if (axis == 0) {
    d += 2 * x * (f[3] - b[3]) + y * (f[4] - b[4]) + 3 * x * x * (f[6] - b[6]);
    d += 2 * x * y * (f[7] - b[7]) + y * y * (f[8] - b[8]);
  } else {
    d += x * (f[4] - b[4]) + 2 * y * (f[5] - b[5]) + x * x * (f[7] - b[7]);
    d += 2 * x * y * (f[8] - b[8]) + 3 * y * y * (f[9] - b[9]);
  }
  return d;
}

// Fills in the cells' levels over black (K, 3) and their slopes (K, 3, 2).
//
// own (K, 4), as cell_means gives them; centroids (K, 2) in the frame of the polynomials; color (K,); scale
// px, of the frame.
void fill_levels(View<const double, 2> own, View<const double, 2> centroids,
                 View<const std::int32_t, 1> color, const InkPolynomials& inks, double scale,
                 LevelArrays& levels) {
  const auto cell = levels.cell.view();
  const auto slope = levels.slope.view();
  const auto is_outlier = levels.is_outlier.view();
  for (Index i = 0; i < own.size(); ++i) {
    // where a corner is unknown, the cell may be drawn in the next step, when that corner is predicted
    const bool is_placed = std::isfinite(centroids(i, 0));
    const double x = is_placed ? centroids(i, 0) : 0.0, y = is_placed ? centroids(i, 1) : 0.0;
    const Monomials terms = monomials(x, y);
    const std::int32_t ink = color[i];
    const bool is_known = own(i, 3) > 0.0;
    double own_share = 0.0;
    if (is_known) {
      const double variance = inks.variance[ink], noise = inks.noise[ink];
      own_share = is_outlier[i] ? 1.0 : variance / (variance + noise * noise / own(i, 3));
    }
    for (Index channel = 0; channel < 3; ++channel) {
      const auto f = inks.coefficients[ink][channel], b = inks.coefficients[BLACK][channel];
      double level = 0.0, black = 0.0;
      for (Index k = 0; k < POLYNOMIAL_TERMS; ++k) {
        level += terms[k] * f[k];
        black += terms[k] * b[k];
      }
      if (is_known) level += own_share * (own(i, channel) - level);
      cell(i, channel) = level - black;
      for (int axis = 0; axis < 2; ++axis)
        slope(i, channel, axis) = (is_outlier[i] ? 0.0 : difference_slope(f, b, x, y, axis)) / scale;
    }
  }
}

// values (B, 4) or (K, 4); centroids likewise; color (K,); all cells where the ink is black.
InkSamples ink_samples(View<const double, 2> values, View<const double, 2> centroids,
                       View<const std::int32_t, 1> color, Index ink) {
  Array<std::int64_t, 1> chosen({values.size()});
  Index n = 0;
  for (Index i = 0; i < values.size(); ++i) {
    if (values(i, 3) > 0.0 && (ink == BLACK || color[i] == ink)) chosen[n++] = i;
  }
  InkSamples out{Array<double, 2>({POLYNOMIAL_TERMS, n}), Array<double, 2>({4, n}), chosen.first(n)};
  for (Index k = 0; k < n; ++k) {
    const Index i = chosen[k];
    const Monomials terms = monomials(centroids(i, 0), centroids(i, 1));
    for (Index term = 0; term < POLYNOMIAL_TERMS; ++term) out.terms(term, k) = terms[term];
    for (Index column = 0; column < 4; ++column) out.values(column, k) = values(i, column);
  }
  return out;
}

// (K, 2) the centroids of cells in the frame of the polynomials, NaN where a corner is unknown.
Array<double, 2> cell_centroids(View<const double, 2> xy, View<const std::int32_t, 2> cells,
                                const image::PolynomialFrame& frame) {
  Array<double, 2> out({cells.size(), 2});
  for (Index i = 0; i < cells.size(); ++i) {
    const Index a = cells(i, 0), b = cells(i, 1), c = cells(i, 2);
    out(i, 0) = ((xy(a, 0) + xy(b, 0) + xy(c, 0)) / 3 - frame.x) / frame.scale;
    out(i, 1) = ((xy(a, 1) + xy(b, 1) + xy(c, 1)) / 3 - frame.y) / frame.scale;
  }
  return out;
}

// The noise of a pixel's light, root mean square of the channels, at the median levels of cells (4, n); noise
// is that of the values.
double noise_of_light(View<const double, 2> own, View<const float, 1> encoded, double noise) {
  double total = 0.0;
  for (Index channel = 0; channel < 3; ++channel) {
    Array<double, 1> levels(own[channel]);
    const auto level = static_cast<float>(numeric::median_of_many(levels));
    const double light = noise / static_cast<double>(encoded[image::table_place(level) + 1]);
    total += light * light;
  }
  return std::sqrt(total / 3.0);
}

// The number of terms of the polynomial of so many cells.
Index terms_for(Index cells, const InkLevelLimits& limits) {
  for (const auto& [from, terms] : limits.cells_for_terms) {
    if (cells >= from) return terms;
  }
  return 1;
}

// The images of which cell_means takes the means, flat.
struct LightImages {
  View<const std::uint8_t, 1> observed;
  View<const float, 1> light;  // (256,) of the values
  View<const float, 1> drawn;  // empty for none
};

// A disc in the image.
struct Disc {
  double x, y, radius;  // px
};

// The mean light of the channels in a disc and the number of its pixels; zeros without any.
template <bool IS_DRAWN>
std::array<double, 4> disc_mean(const Disc& disc, const LightImages& images, Index height, Index width) {
  const Index left = std::max<Index>(static_cast<Index>(std::ceil(disc.x - disc.radius)), 0);
  const Index right = std::min(static_cast<Index>(disc.x + disc.radius), width - 1);
  const Index top = std::max<Index>(static_cast<Index>(std::ceil(disc.y - disc.radius)), 0);
  const Index bottom = std::min(static_cast<Index>(disc.y + disc.radius), height - 1);
  std::array<double, 4> sums{};
  for (Index y = top; y <= bottom; ++y) {
    const double dy = static_cast<double>(y) - disc.y, most = disc.radius * disc.radius - dy * dy;
    for (Index x = left; x <= right; ++x) {
      const double dx = static_cast<double>(x) - disc.x;
      const bool is_inside = dx * dx <= most;  // not a branch, which would be hard to predict
      const Index at = 3 * (y * width + x);
      for (Index channel = 0; channel < 3; ++channel) {
        auto light = static_cast<double>(images.light[images.observed[at + channel]]);
        if constexpr (IS_DRAWN) light -= static_cast<double>(images.drawn[at + channel]);
        sums[channel] += is_inside ? light : 0.0;
      }
      sums[3] += is_inside ? 1.0 : 0.0;
    }
  }
  if (sums[3] == 0.0) return {};
  return {sums[0] / sums[3], sums[1] / sums[3], sums[2] / sums[3], sums[3]};
}

}  // namespace

Array<double, 2> cell_means(View<const std::uint8_t, 3> image, View<const float, 1> light,
                            View<const float, 3> model, View<const double, 2> xy,
                            View<const std::int32_t, 2> cells, double sigma, const DiscLimits& limits) {
  const LightImages images{image.flat(), light, model.flat()};
  const Index height = image.size(0), width = image.size(1);
  const auto right = static_cast<double>(width - 1), bottom = static_cast<double>(height - 1);
  Array<double, 2> out({cells.size(), 4}, 0.0);
  in_parts(cells.size(), 3 * cells.size(), [&](Index begin, Index end) {  // a cell has three gridlines
    for (Index i = begin; i < end; ++i) {
      const CellCorners corners(xy, cells, i);
      const double x = corners.middle_x(), y = corners.middle_y();
      if (!(x >= 0.0 && y >= 0.0 && x <= right && y <= bottom)) continue;
      const Disc disc{x, y, disc_radius(inscribed_radius(corners), sigma, limits)};
      const auto mean = images.drawn.size() > 0 ? disc_mean<true>(disc, images, height, width)
                                                : disc_mean<false>(disc, images, height, width);
      std::copy(mean.begin(), mean.end(), out[i].begin());
    }
  });
  return out;
}

LevelArrays smoothed_levels(View<const double, 2> drawn, View<const double, 2> black,
                            View<const double, 2> xy, const InkCells& pattern, double noise,
                            const image::PyramidLevel& view, const InkLevelLimits& limits) {
  const Index count = drawn.size();
  LevelArrays levels{Array<double, 2>({count, 3}), Array<double, 3>({count, 3, 2}),
                     Array<double, 2>({3, POLYNOMIAL_TERMS}), Array<bool, 1>({count}, false)};
  InkPolynomials inks{Array<double, 3>({INKS, 3, POLYNOMIAL_TERMS}, 0.0), {}, {}};
  inks.noise.fill(1.0);
  const Array<double, 2> centroids = cell_centroids(xy, pattern.cells, view.frame);
  const Array<double, 2> black_centroids = cell_centroids(xy, pattern.black_cells, view.frame);
  for (Index ink = 0; ink < INKS; ++ink) {
    const InkSamples own = ink == BLACK ? ink_samples(black, black_centroids, pattern.color, ink)
                                        : ink_samples(drawn, centroids, pattern.color, ink);
    const Index n = own.numbers.size();
    if (n == 0) continue;
    inks.noise[ink] = noise_of_light(own.values, view.response.encoded, noise);
    const RobustPolynomial fitted =
        robust_polynomial(own.terms, own.values, inks.noise[ink], terms_for(n, limits), limits.polynomial);
    copy<double, 2>(fitted.coefficients, inks.coefficients[ink]);
    inks.variance[ink] = ink == WHITE ? WHITE_VARIANCE : fitted.variance;
    for (Index i = 0; i < n && ink != BLACK; ++i) levels.is_outlier[own.numbers[i]] = fitted.is_outlier[i];
  }
  copy<double, 2>(inks.coefficients[BLACK], levels.black);
  fill_levels(drawn, centroids, pattern.color, inks, view.frame.scale, levels);
  return levels;
}

double level_change(View<const double, 2> before, View<const double, 2> now) {
  Array<double, 1> sizes({before.size()}, 0.0), changes({before.size()}, 0.0);
  for (Index i = 0; i < before.size(); ++i) {
    for (Index channel = 0; channel < 3; ++channel) {
      sizes[i] = std::max(sizes[i], std::abs(before(i, channel)));
      changes[i] = std::max(changes[i], std::abs(now(i, channel) - before(i, channel)));
    }
  }
  const double change = numeric::median_of_many(changes);
  return change / std::max(numeric::median_of_many(sizes), TINY);
}

}  // namespace cmp::refine
