// Room "space" for Python.
#include "base/binding.hpp"

#include "space/triangulation.hpp"

namespace cmp {

// A tuple of views.
template <>
struct FromPython<space::PlacedViews> {
  static space::PlacedViews get(nb::handle object, const Name& name, Borrowed& borrowed) {
    const std::size_t count = nb::len(object);
    if (count > space::MAX_VIEWS) throw nb::type_error((name.text() + " has more than 8 views").c_str());
    space::PlacedViews out{static_cast<int>(count), {}};
    for (std::size_t k = 0; k < count; ++k)
      out.views[k] = space::PlacedView::read(Fields(object[k], name, borrowed));
    return out;
  }
};

}  // namespace cmp

namespace cmp::space {

namespace {

template <int N>
Vector<N> row_of(View<const double, 2> rows, Index k) {
  Vector<N> out;
  for (int i = 0; i < N; ++i) out[i] = rows(k, i);
  return out;
}

template <int R, int C>
void fill(View<double, 2> to, const Matrix<R, C>& from) {
  for (int i = 0; i < R; ++i)
    for (int j = 0; j < C; ++j) to(i, j) = from(i, j);
}

std::tuple<Array<double, 2>, Array<double, 3>> distort(const Lens& lens, View<const double, 2> direction) {
  const Index count = direction.size();
  Array<double, 2> xy({count, 2});
  Array<double, 3> by_direction({count, 2, 2});
  for (Index k = 0; k < count; ++k) {
    const Place place = distorted(lens, row_of<2>(direction, k));
    xy(k, 0) = place.xy[0];
    xy(k, 1) = place.xy[1];
    fill(by_direction[k], place.by_direction);
  }
  return {std::move(xy), std::move(by_direction)};
}

Array<double, 2> undistort(const Lens& lens, View<const double, 2> xy) {
  Array<double, 2> out({xy.size(), 2});
  for (Index k = 0; k < xy.size(); ++k) {
    const Vector<2> direction = undistorted(lens, row_of<2>(xy, k));
    out(k, 0) = direction[0];
    out(k, 1) = direction[1];
  }
  return out;
}

std::tuple<Array<double, 2>, Array<double, 2>, Array<double, 3>, Array<double, 3>> linearise(
    const PlacedView& view, View<const double, 2> xyz_mm) {
  const Index count = xyz_mm.size();
  Array<double, 2> xy({count, 2}), direction({count, 2});
  Array<double, 3> by_point({count, 2, 3}), by_pose({count, 2, 6});
  for (Index k = 0; k < count; ++k) {
    const Picture found = picture(view, row_of<3>(xyz_mm, k));
    for (int i = 0; i < 2; ++i) {
      xy(k, i) = found.xy_px[i];
      direction(k, i) = found.direction[i];
    }
    fill(by_point[k], found.by_point);
    fill(by_pose[k], found.by_pose);
  }
  return {std::move(xy), std::move(direction), std::move(by_point), std::move(by_pose)};
}

std::tuple<Array<double, 2>, Array<double, 2>> rays(const PlacedView& view, View<const double, 2> xy_px) {
  Array<double, 2> origin({xy_px.size(), 3}), direction({xy_px.size(), 3});
  for (Index k = 0; k < xy_px.size(); ++k) {
    const Ray found = ray(view, row_of<2>(xy_px, k));
    for (int i = 0; i < 3; ++i) {
      origin(k, i) = found.origin_mm[i];
      direction(k, i) = found.direction[i];
    }
  }
  return {std::move(origin), std::move(direction)};
}

}  // namespace

void add_space(nb::module_ module) {
  bind<&distort>(module, "distort", {"lens", "direction"});
  bind<&undistort>(module, "undistort", {"lens", "xy"});
  bind<&linearise>(module, "linearise", {"view", "xyz_mm"});
  bind<&rays>(module, "rays", {"view", "xy_px"});
  bind<&triangulate>(module, "triangulate", {"views", "xy_px", "cov_px2", "cov_pose", "gate", "limits"});
}

}  // namespace cmp::space
