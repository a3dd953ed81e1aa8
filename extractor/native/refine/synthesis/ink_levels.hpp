// The ink levels of one image: a level for every cell, from the cell itself and from all cells of its ink.
//
// A cell's own level is noisy, and half of the error would go into its gridlines. Light and print vary
// smoothly from cell to cell as a rule, and a low polynomial over the image, fitted robustly to each ink, is
// far less noisy. Every level is drawn towards the polynomial in the proportion of noise in the cells'
// scatter about the polynomial. Where the scatter is not noise (uneven print, hard shadows, a missing cell)
// the cell's own level stays.
#pragma once

#include <cmath>
#include <tuple>

#include "base/array.hpp"
#include "image/pyramid.hpp"
#include "refine/synthesis/ink_polynomials.hpp"

namespace cmp::refine {

inline constexpr Index INKS = 5;  // red, green, blue, black, white
inline constexpr Index BLACK = 3, WHITE = 4;

// Limits of the disc in a cell's middle, whose mean is the cell's level.
struct DiscLimits {
  double disc_share = 0.55;  // of the inscribed circle's radius, the disc of a cell's level at most. Chosen.
  // the same where nothing is drawn yet, and the neighbours' ink bleeds into the disc. Chosen.
  double first_disc_share = 0.47;
  double clear_sigma = 2.2;  // in units of the blur, the distance of the disc from the cell's sides. Chosen.
  double min_radius_px = 0.75;  // px, of the disc. Chosen.
};

// Limits of ink levels.
struct InkLevelLimits {
  // from so many cells on, so many terms of an ink's polynomial. Derived: polynomials of degree 3, 2, 1 and 0
  // have so many; the cells are chosen.
  std::array<std::array<Index, 2>, 4> cells_for_terms = {{{40, 10}, {18, 6}, {8, 3}, {1, 1}}};
  DiscLimits disc;
  PolynomialLimits polynomial;
};

// The levels of the inks in an image, as light (0 to 255).
struct InkLevels {
  View<const double, 2> cell;      // (K, 3) levels of the drawn cells over black, at their centroids
  View<const double, 3> slope;     // (K, 3, 2) levels per px along x and y
  View<const double, 2> black;     // (3, 10) the polynomial of the black
  View<const bool, 1> is_outlier;  // (K,) cells that do not look like the other cells of their ink

  CMP_RECORD("extractor.refine.synthesis.ink_levels.InkLevels", cell, slope, black, is_outlier)
};

// The same, owned.
struct LevelArrays {
  Array<double, 2> cell;
  Array<double, 3> slope;
  Array<double, 2> black;
  Array<bool, 1> is_outlier;

  CMP_RECORD("extractor.refine.synthesis.ink_levels.InkLevels", cell, slope, black, is_outlier)
};

inline InkLevels levels_of(const LevelArrays& arrays) {
  return {arrays.cell, arrays.slope, arrays.black, arrays.is_outlier};
}

// The cells of the pattern by ink.
struct InkCells {
  View<const std::int32_t, 2> cells;        // (K, 3) marker ids of the drawn cells
  View<const std::int32_t, 2> black_cells;  // (B, 3) marker ids of the black cells
  View<const std::int32_t, 1> color;        // (K,) inks of the drawn cells
};

// The corners of a cell, px.
struct CellCorners {
  double ax, ay, bx, by, cx, cy;

  // cell: its row in the markers' ids (K, 3).
  CellCorners(View<const double, 2> xy, View<const std::int32_t, 2> cells, Index cell)
      : ax(xy(cells(cell, 0), 0)),
        ay(xy(cells(cell, 0), 1)),
        bx(xy(cells(cell, 1), 0)),
        by(xy(cells(cell, 1), 1)),
        cx(xy(cells(cell, 2), 0)),
        cy(xy(cells(cell, 2), 1)) {}

  double middle_x() const { return (ax + bx + cx) / 3; }
  double middle_y() const { return (ay + by + cy) / 3; }
};

// The radius of a cell's inscribed circle, px.
inline double inscribed_radius(const CellCorners& corners) {
  constexpr double TINY = 1e-9;  // keeps the division finite
  const auto [ax, ay, bx, by, cx, cy] = corners;
  const double area = std::abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax));
  double perimeter = std::sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay));
  perimeter += std::sqrt((cx - bx) * (cx - bx) + (cy - by) * (cy - by));
  perimeter += std::sqrt((ax - cx) * (ax - cx) + (ay - cy) * (ay - cy));
  return area / std::max(perimeter, TINY);
}

// The radius of the disc about the centroid that gives the cell's level, px, by the radius of the inscribed
// circle.
//
// sigma px is the blur, 0 where the pattern is drawn.
inline double disc_radius(double inscribed, double sigma, const DiscLimits& limits) {
  const double most = sigma == 0.0 ? limits.disc_share : limits.first_disc_share;
  return std::max(std::min(most * inscribed, inscribed - limits.clear_sigma * sigma), limits.min_radius_px);
}

// (K, 4): the mean light of image - model over a disc about each cell's centroid, 0 to 255, and the number of
// pixels, 0 outside the image.
//
// image (H, W, 3); light (256,) of its values; model (H, W, 3), the drawn light, or empty for 0; xy (M, 2)
// px; cells (K, 3) marker ids; sigma px, the blur; 0 where the pattern is drawn.
Array<double, 2> cell_means(View<const std::uint8_t, 3> image, View<const float, 1> light,
                            View<const float, 3> model, View<const double, 2> xy,
                            View<const std::int32_t, 2> cells, double sigma, const DiscLimits& limits);

// The inks' levels, smoothed over the cells of each ink.
//
// drawn (K, 4), own levels of the drawn cells and their numbers of pixels, as cell_means gives them; black
// (B, 4), the same for the black cells; xy (M, 2) px, NaN where unknown; noise, gray levels, of the image's
// values.
LevelArrays smoothed_levels(View<const double, 2> drawn, View<const double, 2> black,
                            View<const double, 2> xy, const InkCells& pattern, double noise,
                            const image::PyramidLevel& view, const InkLevelLimits& limits);

// The median change of the cells' levels (K, 3), in units of their median level.
double level_change(View<const double, 2> before, View<const double, 2> now);

}  // namespace cmp::refine
