#include "numeric/delaunay.hpp"

#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

namespace cmp::numeric {

namespace {

constexpr double OUTER_RADIUS =
    64.0;  // in units of the points' extent, of the triangle that contains all points
constexpr double ROUNDING_TOLERANCE = 1e-15;  // of determinants, with the extent as unit
constexpr double POINTS_PER_BUCKET =
    3.0;  // mean number of points in a cell of the grid that orders the insertion

struct Extent {
  double low_x, high_x, low_y, high_y;

  explicit Extent(View<const double, 2> points)
      : low_x(points(0, 0)), high_x(low_x), low_y(points(0, 1)), high_y(low_y) {
    for (Index i = 1; i < points.size(); ++i) {
      low_x = std::min(low_x, points(i, 0));
      high_x = std::max(high_x, points(i, 0));
      low_y = std::min(low_y, points(i, 1));
      high_y = std::max(high_y, points(i, 1));
    }
  }
};

// The points' order along the rows of a grid, every other row backwards.
std::vector<std::int32_t> insertion_order(View<const double, 2> points, const Extent& extent) {
  const Index count = points.size();
  const double width = extent.high_x - extent.low_x, height = extent.high_y - extent.low_y;
  const double step =
      std::sqrt(std::max(width * height * POINTS_PER_BUCKET / static_cast<double>(count), 1e-300));
  std::vector<double> key(static_cast<std::size_t>(count));
  for (Index i = 0; i < count; ++i) {
    const double row = std::floor((points(i, 1) - extent.low_y) / step);
    const double along = (points(i, 0) - extent.low_x) / std::max(width, 1e-300);
    key[i] = row + 0.999 * (std::fmod(row, 2.0) == 0.0 ? along : 1.0 - along);
  }
  std::vector<std::int32_t> order(key.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&key](std::int32_t a, std::int32_t b) { return key[a] != key[b] ? key[a] < key[b] : a < b; });
  return order;
}

// A triangulation to which points are added one by one.
class Mesh {
 public:
  Mesh(View<const double, 2> points, const Extent& extent)
      : count_(points.size()),
        xy_({count_ + 3, 2}),
        faces_({2 * count_ + 1, 3}, -1),
        across_({2 * count_ + 1, 3}, -1),
        stack_({4 * count_ + 64}) {
    const double middle_x = 0.5 * (extent.low_x + extent.high_x),
                 middle_y = 0.5 * (extent.low_y + extent.high_y);
    const double unit = std::max({extent.high_x - extent.low_x, extent.high_y - extent.low_y, 1e-300});
    for (Index i = 0; i < count_; ++i) {
      xy_(i, 0) = (points(i, 0) - middle_x) / unit;
      xy_(i, 1) = (points(i, 1) - middle_y) / unit;
    }
    for (int k = 0; k < 3; ++k) {
      const double angle = 0.3 + 2.0 * std::numbers::pi * k / 3.0;
      xy_(count_ + k, 0) = OUTER_RADIUS * std::cos(angle);
      xy_(count_ + k, 1) = OUTER_RADIUS * std::sin(angle);
      faces_(0, k) = static_cast<std::int32_t>(count_ + k);
    }
  }

  void insert(std::int32_t p) {
    const std::int32_t f = locate(p);
    if (f < 0 || is_corner(f, p)) return;
    split(f, p);
    stack_[0] = f;
    stack_[1] = found_;
    stack_[2] = found_ + 1;
    found_ += 2;
    flip(3);
    last_ = f;
  }

  // The triangles without a corner of the outer triangle, renumbered.
  Triangulation inner() const {
    std::vector<std::int32_t> number(static_cast<std::size_t>(found_), -1);
    std::int32_t kept = 0;
    for (std::int32_t f = 0; f < found_; ++f)
      if (std::max({faces_(f, 0), faces_(f, 1), faces_(f, 2)}) < count_) number[f] = kept++;
    Triangulation result{Array<std::int32_t, 2>({kept, 3}), Array<std::int32_t, 2>({kept, 3}, -1)};
    for (std::int32_t f = 0; f < found_; ++f) {
      const std::int32_t n = number[f];
      if (n < 0) continue;
      for (int k = 0; k < 3; ++k) {
        result.faces(n, k) = faces_(f, k);
        if (across_(f, k) >= 0) result.neighbours(n, k) = number[across_(f, k)];
      }
    }
    return result;
  }

 private:
  // Twice the signed area of a, b, p; positive if p lies on the inner side of a triangle's edge a-b.
  double doubled_area(std::int32_t a, std::int32_t b, std::int32_t p) const {
    const double ax = xy_(a, 0), ay = xy_(a, 1);
    return (xy_(b, 0) - ax) * (xy_(p, 1) - ay) - (xy_(b, 1) - ay) * (xy_(p, 0) - ax);
  }

  // Positive if p lies in the circle through a, b, c, which turn positively.
  double in_circle(std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t p) const {
    const double px = xy_(p, 0), py = xy_(p, 1);
    const double ax = xy_(a, 0) - px, ay = xy_(a, 1) - py, bx = xy_(b, 0) - px, by = xy_(b, 1) - py;
    const double cx = xy_(c, 0) - px, cy = xy_(c, 1) - py;
    const double aa = ax * ax + ay * ay, bb = bx * bx + by * by, cc = cx * cx + cy * cy;
    return aa * (bx * cy - by * cx) - bb * (ax * cy - ay * cx) + cc * (ax * by - ay * bx);
  }

  // The triangle that contains p, by a walk from the last one; -1 if rounding makes the walk circular.
  std::int32_t locate(std::int32_t p) const {
    std::int32_t f = last_;
    for (std::int32_t step = 0; step < 4 * found_; ++step) {
      int outside = -1;
      for (int k = 0; k < 3 && outside < 0; ++k)
        if (doubled_area(faces_(f, (k + 1) % 3), faces_(f, (k + 2) % 3), p) < -ROUNDING_TOLERANCE)
          outside = k;
      if (outside < 0) return f;
      f = across_(f, outside);
      if (f < 0) return -1;
    }
    return -1;
  }

  bool is_corner(std::int32_t f, std::int32_t p) const {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t c = faces_(f, k);
      if (xy_(c, 0) == xy_(p, 0) && xy_(c, 1) == xy_(p, 1)) return true;
    }
    return false;
  }

  void set_face(std::int32_t f, std::array<std::int32_t, 3> corners, std::array<std::int32_t, 3> across) {
    for (int k = 0; k < 3; ++k) {
      faces_(f, k) = corners[k];
      across_(f, k) = across[k];
    }
  }

  void update_neighbour(std::int32_t face, std::int32_t old, std::int32_t now) {
    if (face < 0) return;
    for (int k = 0; k < 3; ++k)
      if (across_(face, k) == old) across_(face, k) = now;
  }

  // Splits face f at the point p, which becomes corner 0 of f and of two new faces.
  void split(std::int32_t f, std::int32_t p) {
    const std::int32_t a = faces_(f, 0), b = faces_(f, 1), c = faces_(f, 2);
    const std::int32_t na = across_(f, 0), nb = across_(f, 1), nc = across_(f, 2);
    const std::int32_t g = found_, h = found_ + 1;
    set_face(f, {p, b, c}, {na, g, h});
    set_face(g, {p, c, a}, {nb, h, f});
    set_face(h, {p, a, b}, {nc, f, g});
    update_neighbour(nb, f, g);
    update_neighbour(nc, f, h);
  }

  // Flips edges opposite to the new point, corner 0 of the faces on the stack, until all are Delaunay.
  void flip(Index height) {
    for (Index turns = stack_.size() - height; turns > 0 && height > 0;
         --turns) {  // only rounding could cause more
      const std::int32_t f = stack_[--height], g = across_(f, 0);
      if (g < 0) continue;
      const std::int32_t p = faces_(f, 0), a = faces_(f, 1), b = faces_(f, 2);
      const int k = across_(g, 0) == f ? 0 : across_(g, 1) == f ? 1 : 2;
      const std::int32_t d = faces_(g, k);
      if (!(in_circle(p, a, b, d) > ROUNDING_TOLERANCE)) continue;
      // f = p, a, b and g = d, b, a become f = p, a, d and g = p, d, b
      const std::int32_t beyond_ad = across_(g, (k + 1) % 3), beyond_db = across_(g, (k + 2) % 3);
      const std::int32_t beyond_pb = across_(f, 1);
      faces_(f, 2) = d;
      across_(f, 0) = beyond_ad;
      across_(f, 1) = g;
      set_face(g, {p, d, b}, {beyond_db, beyond_pb, f});
      update_neighbour(beyond_ad, g, f);
      update_neighbour(beyond_pb, f, g);
      stack_[height++] = f;
      stack_[height++] = g;
    }
  }

  Index count_;
  Array<double, 2> xy_;  // the points and the outer triangle, with the points' extent as unit
  Array<std::int32_t, 2> faces_, across_;
  Array<std::int32_t, 1> stack_;
  std::int32_t found_ = 1, last_ = 0;
};

}  // namespace

Triangulation triangulate(View<const double, 2> points) {
  if (points.size() < 3) return {Array<std::int32_t, 2>({0, 3}), Array<std::int32_t, 2>({0, 3})};
  const Extent extent(points);
  Mesh mesh(points, extent);
  for (std::int32_t p : insertion_order(points, extent)) mesh.insert(p);
  return mesh.inner();
}

std::tuple<Array<std::int32_t, 2>, Array<std::int32_t, 2>> delaunay(View<const double, 2> points) {
  Triangulation result = triangulate(points);
  return {std::move(result.faces), std::move(result.neighbours)};
}

}  // namespace cmp::numeric
