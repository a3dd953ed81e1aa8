#include "refine/solve/fisher_information.hpp"

#include <cmath>
#include <limits>

#include "refine/measure/gridline_bending.hpp"
#include "refine/solve/ring_elimination.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

constexpr Index COUPLINGS = 3, BETWEEN = 2;  // of a gridline: start, end, and the two with each other

// Writes the product of the matrix and a vector (M, 2) into out (M, 2).
void fill_product(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                  View<const std::int32_t, 2> edges, View<const double, 2> vector, View<double, 2> out) {
  for (Index m = 0; m < diagonal.size(); ++m) {
    const double x = vector(m, 0), y = vector(m, 1);
    out(m, 0) = diagonal(m, 0) * x + diagonal(m, 1) * y;
    out(m, 1) = diagonal(m, 1) * x + diagonal(m, 2) * y;
  }
  for (Index e = 0; e < edges.size(); ++e) {
    const double b0 = off_diagonal(e, 0), b1 = off_diagonal(e, 1), b2 = off_diagonal(e, 2),
                 b3 = off_diagonal(e, 3);
    if (b0 == 0.0 && b3 == 0.0) continue;
    const Index a = edges(e, 0), b = edges(e, 1);
    const double ax = vector(a, 0), ay = vector(a, 1), bx = vector(b, 0), by = vector(b, 1);
    out(a, 0) += b0 * bx + b1 * by;
    out(a, 1) += b2 * bx + b3 * by;
    out(b, 0) += b0 * ax + b2 * ay;
    out(b, 1) += b1 * ax + b3 * ay;
  }
}

// (M, 3) the inverses of the diagonal blocks.
Array<double, 2> inverse_blocks(View<const double, 2> diagonal) {
  Array<double, 2> out({diagonal.size(), 3});
  const auto inverse = out.view();
  for (Index m = 0; m < diagonal.size(); ++m) {
    const double xx = diagonal(m, 0), xy = diagonal(m, 1), yy = diagonal(m, 2);
    const double determinant = xx * yy - xy * xy;
    inverse(m, 0) = yy / determinant;
    inverse(m, 1) = -xy / determinant;
    inverse(m, 2) = xx / determinant;
  }
  return out;
}

// Writes the preconditioned residual (M, 2) into descent; the product of the two.
double fill_descent(View<const double, 2> inverse, View<const double, 2> residual, View<double, 2> descent) {
  double total = 0.0;
  for (Index m = 0; m < residual.size(); ++m) {
    const double x = residual(m, 0), y = residual(m, 1);
    const double dx = inverse(m, 0) * x + inverse(m, 1) * y, dy = inverse(m, 1) * x + inverse(m, 2) * y;
    descent(m, 0) = dx;
    descent(m, 1) = dy;
    total += x * dx + y * dy;
  }
  return total;
}

// The product of two vectors (M, 2).
double dot(View<const double, 2> one, View<const double, 2> other) {
  double total = 0.0;
  for (Index m = 0; m < one.size(); ++m) total += one(m, 0) * other(m, 0) + one(m, 1) * other(m, 1);
  return total;
}

// The numbers of the selected markers that are known.
Array<std::int64_t, 1> known_markers(View<const double, 2> diagonal, double min_information,
                                     View<const bool, 1> selected) {
  Array<std::int64_t, 1> out({selected.size()});
  Index count = 0;
  for (Index m = 0; m < selected.size(); ++m) {
    if (selected[m] && diagonal(m, 0) + diagonal(m, 2) > min_information) out[count++] = m;
  }
  return out.first(count);
}

// Adds the sums of gridline e, times factors for its start, its end and the two with each other.
void add_gridline(const GridlineSystem& system, Index e, const std::array<double, COUPLINGS>& factors,
                  View<double, 2> diagonal, View<double, 2> off_diagonal) {
  const auto lines = system.lines[e], sums = system.sums[e];
  const double w = system.weight[e] * lines[KNOWN] / system.variance;
  if (w == 0.0) return;
  const double nx = -lines[UY], ny = lines[UX];
  for (Index side = 0; side < 2; ++side) {
    const auto block = diagonal[system.edges(e, side)];
    const double value = w * factors[side] * (side == 0 ? sums[AA] : sums[BB]);
    block[0] += value * nx * nx;
    block[1] += value * nx * ny;
    block[2] += value * ny * ny;
  }
  const auto block = off_diagonal[e];
  const double value = w * factors[BETWEEN] * sums[AB];
  block[0] += value * nx * nx;
  block[1] += value * nx * ny;
  block[2] += value * ny * nx;
  block[3] += value * ny * ny;
}

}  // namespace

Array<double, 2> curving(View<const double, 2> couplings, double scatter_share,
                         View<const double, 2> bend_response) {
  Array<double, 2> out({couplings.size(), COUPLINGS});
  for (Index e = 0; e < couplings.size(); ++e) {
    for (Index k = 0; k < COUPLINGS; ++k) {
      const double by_tangents = couplings(e, k), by_curves = couplings(e, COUPLINGS + k);
      const double coupling = by_tangents + scatter_share * (by_curves - by_tangents);
      out(e, k) = bend_response(e, HELD) * (coupling - 1.0);
    }
  }
  return out;
}

InformationArrays fisher_information(const GridlineSystem& system, View<const double, 1> prior) {
  const auto edges = system.edges;
  InformationArrays out{Array<double, 2>({system.spokes.size(), 3}),
                        Array<double, 2>({edges.size(), 4}, 0.0)};
  const auto diagonal = out.diagonal.view(), off_diagonal = out.off_diagonal.view();
  for (Index m = 0; m < diagonal.size(); ++m) {
    diagonal(m, 0) = diagonal(m, 2) = prior[m];
    diagonal(m, 1) = 0.0;
  }
  for (Index e = 0; e < edges.size(); ++e) {
    const auto own = system.curving[e];
    add_gridline(system, e, {1.0 + own[0], 1.0 + own[1], 1.0 + own[BETWEEN]}, diagonal, off_diagonal);
  }
  return out;
}

void update_curving(InformationArrays& information, const GridlineSystem& system,
                    View<const double, 2> curving) {
  for (Index e = 0; e < system.edges.size(); ++e) {
    const auto own = system.curving[e], other = curving[e];
    add_gridline(system, e, {other[0] - own[0], other[1] - own[1], other[BETWEEN] - own[BETWEEN]},
                 information.diagonal, information.off_diagonal);
  }
}

Array<double, 2> gradient(const GridlineSystem& system, View<const double, 1> gradient_start,
                          View<const double, 1> gradient_end) {
  const auto lines = system.lines;
  const auto edges = system.edges;
  Array<double, 2> out({system.spokes.size(), 2}, 0.0);
  const auto at = out.view();
  for (Index e = 0; e < edges.size(); ++e) {
    if (lines(e, KNOWN) == 0.0) continue;
    const double nx = -lines(e, UY), ny = lines(e, UX);
    for (Index side = 0; side < 2; ++side) {
      const Index m = edges(e, side);
      const double value =
          system.weight[e] * (side == 0 ? gradient_start[e] : gradient_end[e]) / system.variance;
      at(m, 0) += value * nx;
      at(m, 1) += value * ny;
    }
  }
  return out;
}

Array<double, 2> remaining_gradient(const Information& information, View<const std::int32_t, 2> edges,
                                    View<const double, 2> gradient, View<const double, 2> shift) {
  Array<double, 2> out(gradient.shape());
  fill_product(information.diagonal, information.off_diagonal, edges, shift, out);
  for (Index m = 0; m < out.size(); ++m) {
    for (Index axis = 0; axis < 2; ++axis) out(m, axis) = gradient(m, axis) - out(m, axis);
  }
  return out;
}

Array<double, 2> solve_shifts(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                              View<const std::int32_t, 2> edges, View<const double, 2> right,
                              View<const double, 2> whole, const InformationLimits& limits) {
  const Index count = diagonal.size();
  const Array<double, 2> inverse = inverse_blocks(diagonal);
  Array<double, 2> residuals(right), shifts({count, 2}, 0.0), searches({count, 2}, 0.0);
  Array<double, 2> products({count, 2}), descents({count, 2});
  const auto residual = residuals.view(), shift = shifts.view(), search = searches.view();
  const auto product = products.view(), descent = descents.view();
  const double start = fill_descent(inverse, whole, descent);
  double before = 1.0;
  for (Index step = 0; step < limits.max_steps; ++step) {
    const double now = fill_descent(inverse, residual, descent);
    if (!(now > limits.precision * limits.precision * start)) break;
    const double blend = step > 0 ? now / before : 0.0;
    for (Index m = 0; m < count; ++m) {
      search(m, 0) = descent(m, 0) + blend * search(m, 0);
      search(m, 1) = descent(m, 1) + blend * search(m, 1);
    }
    fill_product(diagonal, off_diagonal, edges, search, product);
    const double curvature = dot(search, product);
    if (!(curvature > 0.0)) break;
    const double length = now / curvature;
    for (Index m = 0; m < count; ++m) {
      for (Index axis = 0; axis < 2; ++axis) {
        shift(m, axis) += length * search(m, axis);
        residual(m, axis) -= length * product(m, axis);
      }
    }
    before = now;
  }
  return shifts;
}

Array<double, 3> covariances(View<const double, 2> diagonal, View<const double, 2> off_diagonal,
                             View<const std::int32_t, 2> edges, View<const std::int32_t, 2> spokes,
                             double min_information, View<const bool, 1> selected,
                             const InformationLimits& limits) {
  Array<double, 3> out({diagonal.size(), 2, 2}, std::numeric_limits<double>::quiet_NaN());
  const auto cov = out.view();
  const Array<std::int64_t, 1> asked = known_markers(diagonal, min_information, selected);
  const EliminationBlocks blocks = prepare_elimination(diagonal, off_diagonal, edges, spokes);
  RingLanes ring;
  const auto& middle_xx = ring.tail[MIDDLE];
  const auto& middle_xy = ring.tail[MIDDLE + 1];
  const auto& middle_yy = ring.tail[MIDDLE + 2];
  for (Index start = 0; start < asked.size(); start += RING_LANES) {
    const auto markers = asked.view().slice(start, std::min(start + RING_LANES, asked.size()));
    ring.clear();
    for (Index lane = 0; lane < markers.size(); ++lane) {
      fill_ring(markers[lane], lane, blocks, ring);
      for (Index c = 0; c < 3; ++c) ring.tail[MIDDLE + c][lane] = diagonal(markers[lane], c);
    }
    update_without_ring(ring);
    for (Index lane = 0; lane < markers.size(); ++lane) {
      const Index m = markers[lane];
      const double xx = middle_xx[lane], xy = middle_xy[lane], yy = middle_yy[lane];
      const double determinant = xx * yy - xy * xy, trace = xx + yy;
      if (xx > 0.0 && determinant > limits.min_determinant * (trace * trace) && trace > min_information) {
        cov(m, 0, 0) = yy / determinant;
        cov(m, 1, 1) = xx / determinant;
        cov(m, 0, 1) = cov(m, 1, 0) = -xy / determinant;
      }
    }
  }
  return out;
}

}  // namespace cmp::refine
