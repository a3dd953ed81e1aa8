// Room "space" for Python.
#include "base/binding.hpp"

#include "space/surface.hpp"
#include "space/triangulation.hpp"

namespace cmp {

// An array of that shape; a vector has one dimension.
template <int R, int C>
struct FromPython<space::Matrix<R, C>> {
  using Rows = View<const double, C == 1 ? 1 : 2>;

  static space::Matrix<R, C> get(nb::handle object, const Name& name, Borrowed& borrowed) {
    const Rows rows = FromPython<Rows>::get(object, name, borrowed);
    if (rows.size() != R || (C > 1 && rows.size(1) != C))
      throw nb::type_error((name.text() + " has the wrong shape").c_str());
    return space::Matrix<R, C>::copied(rows);
  }
};

// A tuple of views.
template <>
struct FromPython<space::PlacedViews> {
  static space::PlacedViews get(nb::handle object, const Name& name, Borrowed& borrowed) {
    const std::size_t count = nb::len(object), most = space::MAX_VIEWS;
    if (count > most)
      throw nb::value_error(
          (std::to_string(count) + " views; at most " + std::to_string(most) + " are triangulated").c_str());
    space::PlacedViews out{static_cast<int>(count), {}};
    for (std::size_t k = 0; k < count; ++k)
      out.views[k] = FromPython<space::PlacedView>::get(object[k], name, borrowed);
    return out;
  }
};

template <>
struct TypeName<space::PlacedViews> {
  static std::string get() { return "collections.abc.Sequence[" + TypeName<space::PlacedView>::get() + "]"; }
};

}  // namespace cmp

namespace cmp::space {

namespace {

struct Places {
  Array<double, 2> xy;
  Array<double, 3> by_direction;

  CMP_RECORD("extractor.space.lens.Distorted", xy, by_direction)
};

Places distort(const Lens& lens, View<const double, 2> direction) {
  const Index count = direction.size();
  Places out{Array<double, 2>({count, 2}), Array<double, 3>({count, 2, 2})};
  for (Index k = 0; k < count; ++k) {
    const Place place = distorted(lens, Vector<2>::copied(direction[k]));
    place.xy.copy_to(out.xy[k]);
    place.by_direction.copy_to(out.by_direction[k]);
  }
  return out;
}

Array<double, 2> undistort(const Lens& lens, View<const double, 2> xy) {
  Array<double, 2> out({xy.size(), 2});
  for (Index k = 0; k < xy.size(); ++k) undistorted(lens, Vector<2>::copied(xy[k])).copy_to(out[k]);
  return out;
}

struct Pictures {
  Array<double, 2> xy_px, directions;
  Array<double, 3> by_point, by_pose;

  CMP_RECORD("extractor.space.camera.Linearisation", xy_px, directions, by_point, by_pose)
};

Pictures linearise(const PlacedView& view, View<const double, 2> xyz_mm) {
  const Index count = xyz_mm.size();
  Pictures out{Array<double, 2>({count, 2}), Array<double, 2>({count, 2}), Array<double, 3>({count, 2, 3}),
               Array<double, 3>({count, 2, 6})};
  for (Index k = 0; k < count; ++k) {
    const Picture found = picture(view, Vector<3>::copied(xyz_mm[k]));
    found.xy_px.copy_to(out.xy_px[k]);
    found.direction.copy_to(out.directions[k]);
    found.by_point.copy_to(out.by_point[k]);
    found.by_pose.copy_to(out.by_pose[k]);
  }
  return out;
}

Array<bool, 1> are_ahead(const PlacedView& view, View<const double, 2> xyz_mm) {
  Array<bool, 1> out({xyz_mm.size()});
  for (Index k = 0; k < xyz_mm.size(); ++k) out[k] = view.is_ahead(Vector<3>::copied(xyz_mm[k]));
  return out;
}

struct Rays {
  Array<double, 2> origin_mm, direction;

  CMP_RECORD("extractor.space.medium.Lines", origin_mm, direction)
};

Rays rays(const PlacedView& view, View<const double, 2> xy_px) {
  const Index count = xy_px.size();
  Rays out{Array<double, 2>({count, 3}), Array<double, 2>({count, 3})};
  for (Index k = 0; k < count; ++k) {
    const Ray found = ray(view, Vector<2>::copied(xy_px[k]));
    found.origin_mm.copy_to(out.origin_mm[k]);
    found.direction.copy_to(out.direction[k]);
  }
  return out;
}

}  // namespace

void add_space(nb::module_ module) {
  bind<&distort>(module, "distort", {"lens", "direction"});
  bind<&undistort>(module, "undistort", {"lens", "xy"});
  bind<&linearise>(module, "linearise", {"view", "xyz_mm"});
  bind<&are_ahead>(module, "are_ahead", {"view", "xyz_mm"});
  bind<&rays>(module, "rays", {"view", "xy_px"});
  bind<&gradients>(module, "gradients", {"weights", "around", "values"});
  bind<&points_on_edges>(module, "points_on_edges", {"markers", "edges", "steps_mm", "count"});
  bind<&triangulate>(module, "triangulate", {"views", "xy_px", "cov_px2", "cov_pose", "gate"});
  bind<&inverses>(module, "inverses", {"normal"});
}

}  // namespace cmp::space
