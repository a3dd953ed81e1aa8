#include "contact/settle.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/processor.hpp"

namespace cmp::contact {

namespace {

constexpr Index AXES = 3;
constexpr Index TILE = 4, LANES = 8;  // rows at once, and sums of each, on every processor
constexpr Index BLOCK = 8;            // unknowns in one pass over the matrix, which is longer than the caches

Index padded(Index count, Index multiple) { return (count + multiple - 1) / multiple * multiple; }

// The whitened numbers by each traction, and the measured ones in the row after these; padded by zeros to
// multiples of TILE and LANES.
Array<double, 2> whitened(View<const float, 3> by_load, View<const double, 3> whitening,
                          View<const double, 1> white) {
  const Index count = AXES * by_load.size(), axes = whitening.size(1);
  Array<double, 2> out({padded(count + 1, TILE), padded(white.size(), LANES)}, 0.0);
  for (Index k = 0; k < count; ++k) {
    const View<const float, 1> from = by_load[k / AXES][k % AXES];
    const View<double, 1> to = out[k];
    for (Index m = 0; m < whitening.size(); ++m)
      for (Index i = 0; i < axes; ++i)
        for (Index j = 0; j < axes; ++j) to[m * axes + i] += whitening(m, i, j) * from[m * axes + j];
  }
  std::copy(white.begin(), white.end(), out[count].begin());
  return out;
}

// The products of a row with TILE rows that follow each other.
CMP_PART_OF_LOOP void fill_dots(const double* a, const double* b, Index length, double* out) {
  double sum[TILE][LANES] = {};
  for (Index r = 0; r < length; r += LANES) {
    for (Index t = 0; t < TILE; ++t) {
#pragma omp simd
      for (Index l = 0; l < LANES; ++l) sum[t][l] += a[r + l] * b[t * length + r + l];
    }
  }
  for (Index t = 0; t < TILE; ++t) out[t] = std::accumulate(sum[t], sum[t] + LANES, 0.0);
}

// The products of each row with those up to it, and with what follows in its tile. A tile stays in the cache.
void fill_products(View<const double, 2> rows, View<double, 2> out) {
  for (Index j = 0; j < out.size(); j += TILE)
    for (Index i = j; i < out.size(); ++i)
      fill_dots(rows[i].data(), rows[j].data(), rows.size(1), &out(i, j));
}

// Subtracts the products of `factor` and `pivot` (BLOCK, N) from the lower triangle, from a row and column
// on.
void update_rows(View<double, 2> rows, Index first, View<const double, 2> pivot,
                 View<const double, 2> factor) {
  const double* p[BLOCK];
  for (Index b = 0; b < BLOCK; ++b) p[b] = pivot[b].data();
  for (Index i = first; i < rows.size(); ++i) {
    double f[BLOCK], *row = rows[i].data();
    for (Index b = 0; b < BLOCK; ++b) f[b] = factor(b, i);
#pragma omp simd
    for (Index j = first; j <= i; ++j)
      row[j] -= f[0] * p[0][j] + f[1] * p[1][j] + f[2] * p[2][j] + f[3] * p[3][j] + f[4] * p[4][j] +
                f[5] * p[5][j] + f[6] * p[6][j] + f[7] * p[7][j];
  }
}

// Normal equations of some unknowns: the lower triangle of the matrix bordered by the right-hand side.
class NormalEquations {
 public:
  // products (N + 1, N + 1), of all unknowns.
  NormalEquations(const Array<double, 2>& products, const std::vector<Index>& unknowns)
      : count_(static_cast<Index>(unknowns.size())), rows_({count_ + 1, count_ + 1}) {
    for (Index i = 0; i <= count_; ++i)
      for (Index j = 0; j <= i; ++j)
        rows_(i, j) = products(i < count_ ? unknowns[static_cast<std::size_t>(i)] : products.size() - 1,
                               j < count_ ? unknowns[static_cast<std::size_t>(j)] : 0);
  }

  // Factors the matrix, and gives the solution (N,).
  Array<double, 1> solve() {
    for (Index first = 0; first < count_; first += BLOCK)
      take_in(first, std::min(first + BLOCK, count_), false);
    Array<double, 1> out(rows_[count_].slice(0, count_));
    for (Index k = count_ - 1; k >= 0; --k)
      for (Index j = 0; j < k; ++j) out(j) -= rows_(k, j) * out(k);
    return out;
  }

  // Replaces the matrix by minus its inverse, and the right-hand side by the solution (the sweep operator:
  // Goodnight 1979).
  void invert() {
    for (Index first = 0; first < count_; first += BLOCK)
      take_in(first, std::min(first + BLOCK, count_), true);
  }
  double solution(Index k) const { return rows_(count_, k); }
  double inverse(Index i, Index j) const { return -rows_(std::max(i, j), std::min(i, j)); }

 private:
  // The columns of a block one after the other, then all of them on the other entries; on those before the
  // block only for the inverse.
  void take_in(Index first, Index end, bool is_inverse) {
    const Index n = count_ + 1, size = end - first;
    Array<double, 2> column({BLOCK, n}, 0.0), pivot({BLOCK, n}, 0.0), factor({BLOCK, n}, 0.0);
    const auto entry = [&](Index i, Index b) -> double& {
      return rows_(std::max(i, first + b), std::min(i, first + b));
    };
    const Index from = is_inverse ? 0 : first;
    for (Index b = 0; b < size; ++b)
      for (Index i = from; i < n; ++i) column(b, i) = entry(i, b);
    for (Index b = 0; b < size; ++b) {
      const Index k = first + b;
      const double by_pivot = 1.0 / column(b, k);
      for (Index i = from; i < n; ++i) pivot(b, i) = column(b, i), factor(b, i) = column(b, i) * by_pivot;
      for (Index c = is_inverse ? 0 : b + 1; c < size; ++c) {
        const double at = pivot(b, first + c);
        for (Index i = from; i < n; ++i) column(c, i) -= factor(b, i) * at;
        column(c, k) = at * by_pivot;
      }
      for (Index i = from; i < n; ++i) column(b, i) = factor(b, i);
      column(b, k) = -by_pivot;
    }
    run_loop<update_rows>(rows_.view(), is_inverse ? 0 : end, pivot.view(), factor.view());
    for (Index b = 0; b < size; ++b)
      for (Index i = is_inverse ? 0 : first + b; i < n; ++i) entry(i, b) = column(b, i);
  }

  Index count_;
  Array<double, 2> rows_;
};

std::vector<Index> unknowns_of(const std::vector<Index>& loads) {
  std::vector<Index> out;
  for (const Index load : loads)
    for (Index axis = 0; axis < AXES; ++axis) out.push_back(AXES * load + axis);
  return out;
}

}  // namespace

Settled settle(View<const float, 3> by_load, View<const double, 3> whitening, View<const double, 1> white,
               double information) {
  const Array<double, 2> columns = whitened(by_load, whitening, white);
  Array<double, 2> products({AXES * by_load.size() + 1, columns.size()});
  run_loop<fill_products>(columns.view(), products.view());
  for (Index k = 0; k < AXES * by_load.size(); ++k) products(k, k) += information;
  std::vector<Index> kept(static_cast<std::size_t>(by_load.size()));
  std::iota(kept.begin(), kept.end(), 0);
  for (bool has_settled = kept.empty(); !has_settled;) {
    const Array<double, 1> traction = NormalEquations(products, unknowns_of(kept)).solve();
    Index place = 0;
    has_settled = std::erase_if(kept, [&](Index) { return !(traction(AXES * place++ + 2) < 0); }) == 0;
  }
  const std::vector<Index> unknowns = unknowns_of(kept);
  NormalEquations equations(products, unknowns);
  equations.invert();
  const Index count = static_cast<Index>(unknowns.size());
  Settled out{Array<std::int64_t, 1>({count / AXES}), Array<double, 2>({count / AXES, AXES}),
              Array<double, 2>({count, count}), Array<double, 1>(white)};
  std::copy(kept.begin(), kept.end(), out.kept.begin());
  for (Index i = 0; i < count; ++i) {
    const double traction = out.traction(i / AXES, i % AXES) = equations.solution(i);
    for (Index j = 0; j < count; ++j) out.inverse(i, j) = equations.inverse(i, j);
    const View<const double, 1> column = columns[unknowns[static_cast<std::size_t>(i)]];
    for (Index r = 0; r < white.size(); ++r) out.residual(r) -= traction * column[r];
  }
  return out;
}

}  // namespace cmp::contact
