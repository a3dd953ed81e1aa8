#include "numbering/white_prediction.hpp"

#include <cmath>
#include <limits>

#include "numeric/dense_systems.hpp"

namespace cmp::numbering {

namespace {

constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
constexpr int TERMS = 6;  // 1, x, y, xx, xy, yy
constexpr int CONSTANT = 0, SLOPE_X = 1, SLOPE_Y = 2, FIRST_CURVATURE = 3;
constexpr int FOR_X = 0, FOR_Y = 1, FOR_VARIANCE = 2, RIGHT_SIDES = 3;

// The numbered cells nearest to the white cell in the layout, and their squared distances, mm^2.
struct NearestCells {
  Array<Index, 1> cells;
  Array<double, 1> squares;
  Index count;
};

NearestCells nearest_numbered_cells(View<const std::int32_t, 1> cell, View<const double, 1> white_mm,
                                    View<const double, 2> center_mm, Index most) {
  NearestCells out{Array<Index, 1>({most}), Array<double, 1>({most}), 0};
  const auto nearest = out.cells.view();
  const auto squares = out.squares.view();
  const double white_x = white_mm[0], white_y = white_mm[1];
  for (Index i = 0; i < cell.size(); ++i) {
    const std::int32_t u = cell[i];
    if (u < 0) continue;
    const double x = center_mm(u, 0) - white_x, y = center_mm(u, 1) - white_y, square = x * x + y * y;
    Index k = std::min(out.count, most - 1);
    if (out.count == most && square >= squares[k]) continue;
    for (; k > 0 && squares[k - 1] > square; --k) {
      nearest[k] = nearest[k - 1];
      squares[k] = squares[k - 1];
    }
    nearest[k] = i;
    squares[k] = square;
    out.count = std::min(out.count + 1, most);
  }
  return out;
}

double mean(View<const double, 1> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// The least squares fit of a quadratic map about the white cell; places in the image are relative to the
// nearest cell.
class QuadraticFit {
 public:
  QuadraticFit(View<const double, 2> center_px, View<const std::int32_t, 1> cell,
               const WhiteCellLayout& layout, const NearestCells& near, const WhiteCellLimits& limits)
      : count_(near.count),
        scale_(std::sqrt(mean(near.squares.view().slice(0, near.count)))),
        about_{center_px(near.cells[0], 0), center_px(near.cells[0], 1)},
        rows_({near.count, TERMS}),
        places_({near.count, 2}),
        weight_({near.count}) {
    right_(FOR_VARIANCE, CONSTANT) = 1.0;
    for (Index k = 0; k < count_; ++k) {
      const Index i = near.cells[k];
      const std::int32_t u = cell[i];
      places_(k, 0) = center_px(i, 0) - about_.x;
      places_(k, 1) = center_px(i, 1) - about_.y;
      add((layout.center_mm(u, 0) - layout.white_mm[0]) / scale_,
          (layout.center_mm(u, 1) - layout.white_mm[1]) / scale_, k, limits.weight_softening);
    }
    for (const double weight : View<const double, 1>(weight_)) total_ += weight;
    for (int a = FIRST_CURVATURE; a < TERMS; ++a) normal_(a, a) += limits.ridge * total_;
    is_solved_ = numeric::update_to_cholesky_solution(normal_, right_, TERMS);
  }

  bool is_determined(double min_pivot_share) const {
    const double pivot = normal_(SLOPE_Y, SLOPE_Y);
    return is_solved_ && pivot * pivot > min_pivot_share * total_;
  }
  // px per mm of image axis 0 or 1 along axis 0 or 1 of the layout
  double slope(int axis, int layout_axis) const { return right_(axis, SLOPE_X + layout_axis) / scale_; }
  PlanePoint center() const {
    return {about_.x + right_(FOR_X, CONSTANT), about_.y + right_(FOR_Y, CONSTANT)};
  }
  double center_variance() const {
    return residual() / (2.0 * total_) *
           (1.0 + right_(FOR_VARIANCE, CONSTANT) * total_ / static_cast<double>(count_));
  }

 private:
  // Adds the cell k at (x, y).
  void add(double x, double y, Index k, double softening) {
    const std::array<double, TERMS> row{1.0, x, y, x * x, x * y, y * y};
    const double weight = 1.0 / (softening + x * x + y * y);
    weight_[k] = weight;
    for (int a = 0; a < TERMS; ++a) {
      rows_(k, a) = row[a];
      const double moment = weight * row[a];
      right_(FOR_X, a) += moment * places_(k, 0);
      right_(FOR_Y, a) += moment * places_(k, 1);
      for (int b = 0; b <= a; ++b) normal_(a, b) += moment * row[b];
    }
  }
  double residual() const {
    double sum = 0.0;
    for (Index k = 0; k < count_; ++k) {
      double u = places_(k, 0), v = places_(k, 1);
      for (int a = 0; a < TERMS; ++a) {
        u -= rows_(k, a) * right_(FOR_X, a);
        v -= rows_(k, a) * right_(FOR_Y, a);
      }
      sum += weight_[k] * (u * u + v * v);
    }
    return sum;
  }

  Index count_;
  double scale_;  // mm, of the terms x and y
  PlanePoint about_;
  Array<double, 2> rows_, places_;
  Array<double, 1> weight_;
  Array<double, 2> normal_{{TERMS, TERMS}, 0.0}, right_{{RIGHT_SIDES, TERMS}, 0.0};
  double total_ = 0.0;
  bool is_solved_ = false;
};

}  // namespace

AxialMap predict_white_cell(View<const double, 2> center_px, View<const std::int32_t, 1> cell,
                            const WhiteCellLayout& layout, const WhiteCellLimits& limits) {
  const AxialMap unknown{{NOWHERE, NOWHERE}, NOWHERE, NOWHERE, NOWHERE, NOWHERE};
  const auto near = nearest_numbered_cells(cell, layout.white_mm, layout.center_mm, limits.max_fit_cells);
  if (near.count < limits.min_fit_cells) return unknown;
  const QuadraticFit fit(center_px, cell, layout, near, limits);
  if (!fit.is_determined(limits.min_pivot_share)) return unknown;
  const double xx = fit.slope(0, 0), xy = fit.slope(0, 1), yx = fit.slope(1, 0), yy = fit.slope(1, 1);
  const auto axial_mm = layout.axial_mm;
  const double determinant =
      (xx * yy - xy * yx) * (axial_mm(0, 0) * axial_mm(1, 1) - axial_mm(0, 1) * axial_mm(1, 0));
  const double edge2 = std::abs(determinant) * 2.0 / std::sqrt(3.0);
  const double deviation = limits.max_predicted_deviation;
  if (!(fit.center_variance() < deviation * deviation * edge2)) return unknown;
  return {fit.center(), xx * axial_mm(0, 0) + xy * axial_mm(1, 0), xx * axial_mm(0, 1) + xy * axial_mm(1, 1),
          yx * axial_mm(0, 0) + yy * axial_mm(1, 0), yx * axial_mm(0, 1) + yy * axial_mm(1, 1)};
}

}  // namespace cmp::numbering
