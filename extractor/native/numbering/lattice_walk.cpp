#include "numbering/lattice_walk.hpp"

#include <cstdlib>

#include "layout/lattice_tables.hpp"
#include "numbering/mesh_parts.hpp"

namespace cmp::numbering {

namespace {

using layout::UNKNOWN_AXIAL;

struct Mesh {
  View<const std::int32_t, 2> faces, neighbours;
  View<const std::int8_t, 1> orientation;
  int front;  // orientation of the faces that are markers
};

// A walk over all cells that are connected with one face.
class Walk {
 public:
  Walk(const Mesh& mesh, View<const bool, 1> blocked, std::int32_t reach)
      : mesh_(mesh),
        blocked_(blocked),
        reach_(reach),
        axial_({blocked.size(), 2}, UNKNOWN_AXIAL),
        bad_({blocked.size()}, false),
        lookup_({2 * reach + 1, 2 * reach + 1}, -1),
        queue_({mesh.faces.size()}),
        is_queued_({mesh.faces.size()}, false) {}

  void walk_from(std::int64_t start) {
    place_first_face(start);
    add_to_queue(static_cast<std::int32_t>(start));
    for (Index begin = 0; begin < end_; ++begin) {
      const std::int32_t face = queue_[begin];
      for (int k = 0; k < 3; ++k) {
        const std::int32_t across = mesh_.neighbours(face, k);
        if (across >= 0 && place_fourth_cell(face, k, mesh_.faces(across, k)) && !is_queued_[across])
          add_to_queue(across);
      }
    }
  }
  bool is_contradicted() const {
    const auto bad = bad_.view();
    return std::find(bad.begin(), bad.end(), true) != bad.end();
  }
  View<const bool, 1> contradicted() const { return bad_; }
  Array<std::int32_t, 2>& axial() { return axial_; }

 private:
  void add_to_queue(std::int32_t face) {
    queue_[end_++] = face;
    is_queued_[face] = true;
  }
  // around marker (0, 0) red is (0, 0), green (0, -1), blue (-1, 0); around the white cell green is (-1, 1)
  void place_first_face(std::int64_t face) {
    const bool is_marker = mesh_.orientation[face] == mesh_.front;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t i = mesh_.faces(face, k);
      axial_(i, 0) = k == 0 || (k == 1 && is_marker) ? 0 : -1;
      axial_(i, 1) = k != 1 ? 0 : is_marker ? -1 : 1;
      lookup_(axial_(i, 0) + reach_, axial_(i, 1) + reach_) = i;
    }
  }
  // Places the cell across the edge of a face opposite to its cell k; false where it is not walked to.
  bool place_fourth_cell(std::int32_t face, int k, std::int32_t cell) {
    if (blocked_[cell]) return false;
    const std::int32_t a = mesh_.faces(face, (k + 1) % 3), b = mesh_.faces(face, (k + 2) % 3);
    const std::int32_t c = mesh_.faces(face, k);
    const std::int32_t q = axial_(a, 0) + axial_(b, 0) - axial_(c, 0);
    const std::int32_t r = axial_(a, 1) + axial_(b, 1) - axial_(c, 1);
    if (axial_(cell, 0) != UNKNOWN_AXIAL) {
      if (axial_(cell, 0) == q && axial_(cell, 1) == r) return true;
      bad_[cell] = true;
      return false;
    }
    if (std::abs(q) > reach_ || std::abs(r) > reach_) return false;
    std::int32_t& owner = lookup_(q + reach_, r + reach_);
    if (owner >= 0) {
      bad_[cell] = true;
      bad_[owner] = true;
      return false;
    }
    axial_(cell, 0) = q;
    axial_(cell, 1) = r;
    owner = cell;
    return true;
  }

  const Mesh& mesh_;
  View<const bool, 1> blocked_;
  std::int32_t reach_;
  Array<std::int32_t, 2> axial_;
  Array<bool, 1> bad_;
  Array<std::int32_t, 2> lookup_;
  Array<std::int32_t, 1> queue_;
  Array<bool, 1> is_queued_;
  Index end_ = 0;
};

}  // namespace

std::tuple<Array<std::int32_t, 2>, std::int64_t, std::int64_t> walk_component(
    View<const double, 2> center, View<const std::int32_t, 2> faces, View<const std::int32_t, 2> neighbours,
    View<const std::int8_t, 1> orientation, View<const std::int64_t, 1> component, int front,
    std::int32_t reach, const WalkLimits& limits) {
  const Mesh mesh{faces, neighbours, orientation, front};
  Array<bool, 1> blocked({center.size()}, false);
  for (Index round = 0; round < limits.max_rounds; ++round) {
    const std::int64_t start = most_central_face(center, faces, component, blocked);
    if (start < 0) break;
    Walk walk(mesh, blocked, reach);
    walk.walk_from(start);
    if (!walk.is_contradicted()) {
      std::int64_t walked = 0;
      for (Index i = 0; i < center.size(); ++i) walked += walk.axial()(i, 0) != UNKNOWN_AXIAL;
      return {std::move(walk.axial()), walked, std::count(blocked.begin(), blocked.end(), true)};
    }
    const auto bad = walk.contradicted();
    for (Index i = 0; i < bad.size(); ++i) blocked[i] |= bad[i];
  }
  return {Array<std::int32_t, 2>({center.size(), 2}, UNKNOWN_AXIAL), 0,
          std::count(blocked.begin(), blocked.end(), true)};
}

std::int64_t count_meshed_cells(View<const std::int32_t, 2> faces, View<const std::int8_t, 1> orientation,
                                Index count) {
  Array<bool, 1> has_face({count}, false);
  const auto is_meshed = has_face.view();
  for (Index f = 0; f < orientation.size(); ++f)
    if (orientation[f] != 0)
      for (int k = 0; k < 3; ++k) is_meshed[faces(f, k)] = true;
  return std::count(has_face.begin(), has_face.end(), true);
}

}  // namespace cmp::numbering
