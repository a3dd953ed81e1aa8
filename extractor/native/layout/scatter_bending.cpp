#include "layout/scatter_bending.hpp"

namespace cmp::layout {

namespace {

constexpr Index WAYS = 2;  // by tangents, by second derivatives

// A symmetric matrix.
struct Square {
  double xx = 0.0, xy = 0.0, yy = 0.0;

  // Adds the outer product of a vector, times a factor.
  void add(double x, double y, double factor) {
    xx += factor * x * x;
    xy += factor * x * y;
    yy += factor * y * y;
  }
};

// How one marker's scatter shifts another marker: the matrix, by rows.
std::array<double, 4> shift_by(const Square& gridlines, const Square& pull) {
  const double scale = 1.0 / (gridlines.xx * gridlines.yy - gridlines.xy * gridlines.xy);
  return {scale * (gridlines.yy * pull.xx - gridlines.xy * pull.xy),
          scale * (gridlines.yy * pull.xy - gridlines.xy * pull.yy),
          scale * (gridlines.xx * pull.xy - gridlines.xy * pull.xx),
          scale * (gridlines.xx * pull.yy - gridlines.xy * pull.xy)};
}

double dot(const std::array<double, 4>& one, const std::array<double, 4>& other) {
  double sum = 0.0;
  for (Index k = 0; k < 4; ++k) sum += one[k] * other[k];
  return sum;
}

}  // namespace

Array<double, 2> scatter_bending(View<const std::int64_t, 2> ids, View<const double, 3> weights,
                                 View<const double, 2> normals, View<const std::int32_t, 2> spokes) {
  Array<double, 2> out({spokes.size(), 3}, 0.0);
  Array<std::array<Square, WAYS>, 1> pulls({spokes.size()});
  Array<bool, 1> is_met({spokes.size()}, false);
  Array<std::int64_t, 1> met({spokes.size(1) * ids.size(1)});
  for (Index m = 0; m < spokes.size(); ++m) {
    Square gridlines;
    Index count = 0;
    for (const std::int32_t e : spokes[m]) {
      if (e < 0) continue;
      const double nx = normals(e, 0), ny = normals(e, 1);
      gridlines.add(nx, ny, 1.0);
      for (Index k = 0; k < ids.size(1); ++k) {
        const Index id = ids(e, k);
        if (!is_met[id]) {
          is_met[id] = true;
          pulls[id] = {};
          met[count++] = id;
        }
        for (Index way = 0; way < WAYS; ++way) pulls[id][way].add(nx, ny, weights(way, e, k));
      }
    }
    const double each = 0.25 * (gridlines.xx + gridlines.yy);  // half of the gridlines, half of the two axes
    for (const std::int64_t id : met.first(count)) {
      const auto tangents = shift_by(gridlines, pulls[id][0]), curves = shift_by(gridlines, pulls[id][1]);
      out(m, 0) += each * dot(tangents, tangents);
      out(m, 1) += each * dot(tangents, curves);
      out(m, 2) += each * dot(curves, curves);
      is_met[id] = false;
    }
  }
  return out;
}

}  // namespace cmp::layout
