#include "refine/synthesis/pattern_drawing.hpp"

#include <cmath>
#include <memory>

#include "base/parts.hpp"
#include "base/processor.hpp"
#include "refine/synthesis/cell_coverage.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

namespace {

// A cell's color over black as a plane over the image.
struct ColorPlane {
  double x, y;                  // px, the centroid, from the origin of the pixels' places
  View<const double, 1> level;  // (3,) gray levels at the centroid
  View<const double, 2> slope;  // (3, 2) gray levels per px along x and y
};

// Pixels in a row of the image.
struct PixelRun {
  Index x, y, count;
};

// Fills in the three channels of pixels: the color of the plane times the pixels' shares.
void fill_colors(const ColorPlane& plane, Index count, CellPixels& pixels) {
  const auto level = plane.level;
  const auto slope = plane.slope;
  const auto l0 = static_cast<float>(level[0]), l1 = static_cast<float>(level[1]),
             l2 = static_cast<float>(level[2]);
  const auto r0 = static_cast<float>(slope(0, 0)), d0 = static_cast<float>(slope(0, 1));
  const auto r1 = static_cast<float>(slope(1, 0)), d1 = static_cast<float>(slope(1, 1));
  const auto r2 = static_cast<float>(slope(2, 0)), d2 = static_cast<float>(slope(2, 1));
  const auto x0 = static_cast<float>(plane.x), y0 = static_cast<float>(plane.y);
  const Index padded = padded_count(count);
#pragma omp simd
  for (Index k = 0; k < padded; ++k) {
    const float x = pixels.x[k] - x0, y = pixels.y[k] - y0, share = pixels.share[k];
    pixels.color[3 * k] = share * (l0 + r0 * x + d0 * y);
    pixels.color[3 * k + 1] = share * (l1 + r1 * x + d1 * y);
    pixels.color[3 * k + 2] = share * (l2 + r2 * x + d2 * y);
  }
}

// Draws cells one by one.
class CellDrawing {
 public:
  CellDrawing(const CellGeometry& geometry, const CellAppearance& appearance, View<const std::int64_t, 1> box,
              View<float, 3> model)
      : geometry_(geometry),
        appearance_(appearance),
        left_(box[0]),
        top_(box[1]),
        right_(box[2] - 1),
        bottom_(box[3] - 1),
        width_(model.size(1)),
        flat_(model.flat()),
        low_({model.size() + PIXEL_LANES}),
        high_({model.size() + PIXEL_LANES}),
        pixels_(new CellPixels) {}

  void draw(Index i) {
    const auto cell = geometry_.cells[i];
    const double sigma = appearance_.sigma;
    const auto a = geometry_.xy[cell[0]], b = geometry_.xy[cell[1]], c = geometry_.xy[cell[2]];
    const double ax = a[0], ay = a[1], bx = b[0], by = b[1], cx = c[0], cy = c[1];
    const double turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.0 ? 1.0 : -1.0;
    const CellOutline outline =
        cell_outline(cell, geometry_.cell_edges[i], geometry_.edges, geometry_.lines, turn, sigma);
    const double reach = outline.far * sigma;
    const Index top = std::max(static_cast<Index>(std::ceil(std::min({ay, by, cy}) - reach)), top_);
    const Index bottom = std::min(static_cast<Index>(std::max({ay, by, cy}) + reach), bottom_);
    const RowSpan most{std::max(std::ceil(std::min({ax, bx, cx}) - reach), static_cast<double>(left_)),
                       std::min(std::floor(std::max({ax, bx, cx}) + reach), static_cast<double>(right_))};
    fill_row_ends(outline, static_cast<double>(top), std::max<Index>(bottom + 1 - top, 0), most, low_, high_);
    const double middle_x = (ax + bx + cx) / 3, middle_y = (ay + by + cy) / 3;
    const double x0 = std::floor(middle_x), y0 = std::floor(middle_y);
    const ColorPlane plane{middle_x - x0, middle_y - y0, appearance_.levels[i], appearance_.slopes[i]};
    for (PixelRun next{0, top, 0}; next.y <= bottom;) {
      next = fill_runs(next, top, bottom, x0, y0);
      fill_coverage(count_, x0, y0, outline, *pixels_);
      run_loop<fill_colors>(plane, count_, *pixels_);
      add_colors();
    }
  }

 private:
  // Fills in the pixels between the ends of rows, up to CHUNK of them; the place of the next one.
  PixelRun fill_runs(PixelRun next, Index top, Index bottom, double x0, double y0) {
    filled_ = 0, count_ = 0;
    for (; next.y <= bottom; next = {0, next.y + 1, 0}) {
      next.x = std::max(next.x, static_cast<Index>(std::ceil(low_[next.y - top])));
      const auto end = static_cast<Index>(std::floor(high_[next.y - top]));
      next.count = std::min(end - next.x + 1, CHUNK - count_);
      if (next.count > 0) {
        runs_[filled_++] = next;
        fill_places(next, x0, y0);
        count_ += next.count;
        next.x += next.count;
      }
      if (next.x <= end) break;
    }
    return next;
  }

  // Fills in the places of the pixels of a run, from (x0, y0), after those that are there.
  void fill_places(const PixelRun& run, double x0, double y0) {
    const auto x = static_cast<float>(static_cast<double>(run.x) - x0);
    const auto y = static_cast<float>(static_cast<double>(run.y) - y0);
    const Index padded = padded_count(run.count);
    float *const to_x = pixels_->x.data() + count_, *const to_y = pixels_->y.data() + count_;
    for (std::int32_t j = 0; j < padded; ++j) {
      to_x[j] = x + static_cast<float>(j);
      to_y[j] = y;
    }
  }

  // Adds the colors of the pixels to the image.
  void add_colors() const {
    const float* colors = pixels_->color.data();
    for (Index i = 0; i < filled_; ++i) {
      const PixelRun& run = runs_[i];
      float* const to = flat_.data() + 3 * (run.y * width_ + run.x);
      const Index own = 3 * run.count;
      for (Index k = 0; k < own; ++k) to[k] += colors[k];
      colors += own;
    }
  }

  CellGeometry geometry_;
  CellAppearance appearance_;
  Index left_, top_, right_, bottom_;  // px, the outermost pixels that are drawn
  Index width_;                        // px, of the image
  View<float, 1> flat_;                // the drawing
  Array<double, 1> low_, high_;        // px, the ends of the rows of a cell
  std::unique_ptr<CellPixels> pixels_;
  std::array<PixelRun, CHUNK> runs_;
  Index filled_ = 0, count_ = 0;  // runs and pixels
};

}  // namespace

void draw_cells(const CellGeometry& geometry, const CellAppearance& appearance,
                View<const std::int64_t, 1> box, View<float, 3> model) {
  const auto lines = geometry.lines;
  const Index top = box[1];
  // every pixel belongs to one part, which adds the cells in their order
  in_parts(box[3] - top, geometry.edges.size(), [&](Index begin, Index end) {
    const std::array<std::int64_t, 4> band{box[0], top + begin, box[2], top + end};
    const View<const std::int64_t, 1> rows(band.data(), {4});
    for (Index y = band[1]; y < band[3]; ++y) model[y].slice(box[0], box[2]).flat().fill(0.0F);
    const auto drawing = std::make_unique<CellDrawing>(geometry, appearance, rows, model);
    for (Index i = 0; i < geometry.cells.size(); ++i) {
      const auto edges = geometry.cell_edges[i];
      if (lines(edges[0], KNOWN) * lines(edges[1], KNOWN) * lines(edges[2], KNOWN) > 0.0) drawing->draw(i);
    }
  });
}

}  // namespace cmp::refine
