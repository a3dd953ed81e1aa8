#include "refine/synthesis/cell_coverage.hpp"

#include <cmath>

#include "base/processor.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

namespace {

constexpr auto REACH = static_cast<float>(numeric::NORMAL_REACH);

// A side in units of the blur.
//
// line (8,), as gridlines gives it; forward: the gridline runs from the side's first corner to the second;
// sense: 1 where the gridline's normal points into the cell, else -1; inverse 1/px, of the blur.
CellSide cell_side(View<const double, 1> line, bool forward, double sense, double inverse) {
  const double nx = -line[UY] * sense * inverse, ny = line[UX] * sense * inverse;
  const double ux = line[UX] * inverse, uy = line[UY] * inverse, length = line[LENGTH] * inverse;
  const double along = -(ux * line[X] + uy * line[Y]);
  const std::array<double, 3> distance{-(nx * line[X] + ny * line[Y]), nx, ny};
  if (forward) return {distance, {along, ux, uy}, length, sense * line[LEAVE], sense * line[ARRIVE]};
  return {distance, {length - along, -ux, -uy}, length, -sense * line[ARRIVE], -sense * line[LEAVE]};
}

// The cosine between the directions of a side at its end and of the next side at its start; sigma px is the
// blur.
double corner_cosine(const CellSide& one, const CellSide& other, double sigma) {
  const double end = one.arrive, start = other.leave;
  // the directions of curved sides are those of their chords, turned by their slopes
  const double x = one.along[1] + end * one.distance[1], y = one.along[2] + end * one.distance[2];
  const double cosine =
      x * (other.along[1] + start * other.distance[1]) + y * (other.along[2] + start * other.distance[2]);
  return cosine * sigma * sigma / std::sqrt((1.0 + end * end) * (1.0 + start * start));
}

// Fills in the distances of the pixels inside a side, in units of the blur.
//
// (x0, y0) px is the origin of the pixels' places. Beyond `far` the distance is that from the chord.
CMP_PART_OF_LOOP void fill_distances(Index k, Index count, double x0, double y0, const CellOutline& outline,
                                     CellPixels& pixels) {
  const CellSide& side = outline.sides[k];
  CellColumn& out = pixels.distance[k];
  const auto limit = static_cast<float>(outline.far);
  // in float64, as small numbers are differences of large ones
  const auto d0 = static_cast<float>(side.distance[0] + side.distance[1] * x0 + side.distance[2] * y0);
  const auto dx = static_cast<float>(side.distance[1]), dy = static_cast<float>(side.distance[2]);
  const double inverse = 1.0 / side.length, start = side.along[0] + side.along[1] * x0 + side.along[2] * y0;
  const auto t0 = static_cast<float>(start * inverse);
  const auto tx = static_cast<float>(side.along[1] * inverse),
             ty = static_cast<float>(side.along[2] * inverse);
  const auto leave = static_cast<float>(side.length * side.leave);
  const auto arrive = static_cast<float>(side.length * side.arrive);
  // blur moves a curved edge towards the centre of its curvature, by half of the curvature times the squared
  // blur
  const auto bend = static_cast<float>(3.0 * (side.leave + side.arrive) * inverse);
  const auto bent = static_cast<float>((2.0 * side.leave + side.arrive) * inverse);
  for (Index i = 0; i < count; ++i) {
    const float x = pixels.x[i], y = pixels.y[i];
    const float d = d0 + dx * x + dy * y, t = t0 + tx * x + ty * y;
    const float inside = std::min(std::max(t, 0.0F), 1.0F);
    const float rest = 1.0F - inside;
    float off = inside * rest * (leave * rest - arrive * inside);
    off += leave * std::min(t, 0.0F) + arrive * std::max(t - 1.0F, 0.0F);
    const float curved = d - off - (bend * inside - bent);
    out[i] = d < limit ? curved : d;
  }
}

// The share of a side's half plane at the distance d inside the side.
inline float half_plane_coverage(float d) {
  const float share = numeric::normal_cdf(std::max(d, -REACH));
  return d >= REACH ? 1.0F : share;
}

// The share of a wedge less the product of its sides' shares, at the distances d and `other` inside them.
inline float wedge_share(float d, float other, const numeric::CornerTerms& corner) {
  const float a = std::max(d, -REACH), b = std::max(other, -REACH);
  const float share = numeric::wedge_correlation(a * a + b * b, a * b, corner);
  return std::max(a, b) < REACH ? share : 0.0F;
}

// Replaces the distances inside the three sides by the least, the middle and the largest, and fills in the
// corner between the two sides of the first two.
CMP_PART_OF_LOOP void sort_distances(Index count, CellPixels& pixels) {
  auto& distance = pixels.distance;
  for (Index k = 0; k < count; ++k) {
    const float d0 = distance[0][k], d1 = distance[1][k], d2 = distance[2][k];
    const float less = std::min(d0, d1), more = std::max(d0, d1), high = std::max(more, d2);
    distance[0][k] = std::min(less, d2);
    distance[1][k] = std::max(less, std::min(more, d2));
    const std::int32_t is_last = high == d2, is_first = high == d0;
    pixels.corner[k] = is_last ? 0 : 2 - is_first;
  }
}

// Fills in the shares of the pixels of a cell so large that no pixel is near to all three sides.
//
// Short loops one after the other: in a long one the processor waits, and the compiler entangles the
// conditions.
CMP_PART_OF_LOOP void fill_two_side_coverage(const CellOutline& outline, Index count, CellPixels& pixels) {
  const auto [c01, c12, c20] = outline.corners;
  const auto &nearest = pixels.distance[0], &next = pixels.distance[1];
  sort_distances(count, pixels);
  for (Index k = 0; k < count; ++k) {
    const std::int32_t own = pixels.corner[k];
    numeric::CornerTerms corner;
    for (std::size_t i = 0; i < corner.size(); ++i) {
      const float other = own == 1 ? c12[i] : c20[i];
      corner[i] = own == 0 ? c01[i] : other;
    }
    pixels.wedge[k] = wedge_share(nearest[k], next[k], corner);
  }
  for (Index k = 0; k < count; ++k) {
    const float low = nearest[k], middle = next[k];
    const float one = half_plane_coverage(low);
    const float share = one * half_plane_coverage(middle) + pixels.wedge[k];
    pixels.share[k] = low > -REACH ? share : 0.0F;
  }
}

// Adds the shares of the wedge between the sides k and k + 1 less the products of these sides' shares.
CMP_PART_OF_LOOP void add_wedge(Index k, const CellOutline& outline, Index count, CellPixels& pixels) {
  const numeric::CornerTerms corner = outline.corners[k];
  const auto &one = pixels.distance[k], &other = pixels.distance[(k + 1) % 3];
  for (Index i = 0; i < count; ++i) pixels.wedge[i] += wedge_share(one[i], other[i], corner);
}

// Fills in the shares of the pixels of any cell.
CMP_PART_OF_LOOP void fill_three_side_coverage(const CellOutline& outline, Index count, CellPixels& pixels) {
  const auto& distance = pixels.distance;
  std::fill_n(pixels.wedge.begin(), count, 0.0F);
  for (Index k = 0; k < 3; ++k) add_wedge(k, outline, count, pixels);
  for (Index k = 0; k < count; ++k) {
    const float d0 = distance[0][k], d1 = distance[1][k], d2 = distance[2][k];
    const float s0 = half_plane_coverage(d0), s1 = half_plane_coverage(d1), s2 = half_plane_coverage(d2);
    float share = 1.0F - s0 - s1 - s2 + s0 * s1 + s1 * s2 + s2 * s0;
    share += pixels.wedge[k];
    pixels.share[k] = std::min(std::min(d0, d1), d2) > -REACH ? std::max(share, 0.0F) : 0.0F;
  }
}

// Whether a pixel may be near to all three sides of a cell: by the radius of the inscribed circle.
bool is_small(const std::array<CellSide, 3>& sides) {
  const double a = sides[0].length, b = sides[1].length, c = sides[2].length;
  const double perimeter = a + b + c;
  double bow = 0.0;
  for (const CellSide& side : sides)
    bow = std::max(bow, 0.25 * side.length * std::max(std::abs(side.leave), std::abs(side.arrive)));
  const double square =
      (perimeter - 2.0 * a) * (perimeter - 2.0 * b) * (perimeter - 2.0 * c) / (4.0 * perimeter);
  return square < (numeric::NORMAL_REACH + bow) * (numeric::NORMAL_REACH + bow);
}

// Fills in the shares of a cell in pixels; see fill_coverage.
void fill_shares(Index count, double x0, double y0, const CellOutline& outline, CellPixels& pixels) {
  const Index padded = padded_count(count);
  for (Index k = 0; k < 3; ++k) fill_distances(k, padded, x0, y0, outline, pixels);
  if (is_small(outline.sides)) {
    fill_three_side_coverage(outline, padded, pixels);
  } else {
    fill_two_side_coverage(outline, padded, pixels);
  }
}

}  // namespace

CellOutline cell_outline(View<const std::int32_t, 1> cell, View<const std::int32_t, 1> cell_edges,
                         View<const std::int32_t, 2> edges, View<const double, 2> lines, double turn,
                         double sigma) {
  CellOutline out;
  double bulge = 0.0;  // in units of the blur, the largest possible offset of a side from its chord
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int32_t e = cell_edges[k];
    const bool forward = edges(e, 0) == cell[k];
    const CellSide side = cell_side(lines[e], forward, forward ? turn : -turn, 1.0 / sigma);
    bulge = std::max(bulge, (0.25 * side.length + numeric::NORMAL_REACH) *
                                std::max(std::abs(side.leave), std::abs(side.arrive)));
    out.sides[k] = side;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    auto& corner = out.corners[k];
    numeric::fill_corner_terms(corner_cosine(out.sides[k], out.sides[(k + 1) % 3], sigma),
                               {corner.data(), {numeric::CORNER_TERMS}});
  }
  out.far = numeric::NORMAL_REACH + bulge;
  return out;
}

void fill_row_ends(const CellOutline& outline, double top, Index count, const RowSpan& most,
                   View<double, 1> low, View<double, 1> high) {
  constexpr double ALONG_ROWS = 1e-9;  // a side along the rows excludes whole rows or none
  const Index padded = padded_count(count);
  low.slice(0, padded).fill(most.left);
  high.slice(0, padded).fill(most.right);
  for (const CellSide& side : outline.sides) {
    const auto [offset, dx, dy] = side.distance;
    const double nx = std::abs(dx) > ALONG_ROWS ? dx : ALONG_ROWS;
    const double x = -(offset + dy * top + outline.far) / nx, lean = -dy / nx;
    if (nx > 0.0) {
      for (std::int32_t i = 0; i < padded; ++i) low[i] = std::max(low[i], x + lean * i);
    } else {
      for (std::int32_t i = 0; i < padded; ++i) high[i] = std::min(high[i], x + lean * i);
    }
  }
}

void fill_coverage(Index count, double x0, double y0, const CellOutline& outline, CellPixels& pixels) {
  run_loop<fill_shares>(count, x0, y0, outline, pixels);
}

}  // namespace cmp::refine
