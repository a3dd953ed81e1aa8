// The connected components of the cell mesh, and the faces that are markers: the start of the numbering.
#pragma once

#include <tuple>

#include "base/array.hpp"

namespace cmp::numbering {

// Limits of the samples that tell markers from black cells; explained in extractor/numbering/mesh_parts.py.
struct MarkerTurnLimits {
  Index max_sampled_faces, min_sampled_faces;
  double sample_radius;

  template <class F>
  static MarkerTurnLimits read(const F& f) {
    return {f["max_sampled_faces"], f["min_sampled_faces"], f["sample_radius"]};
  }
};

// The connected components of a graph.
//
// neighbours (N, K), -1 for none; member (N,), the nodes of the graph.
// (N,) the component of each member, counted from 0; -1 for the others.
Array<std::int32_t, 1> connected_components(View<const std::int32_t, 2> neighbours,
                                            View<const bool, 1> member);

// The faces, component by component, the largest first, and the index at which each component begins.
std::tuple<Array<std::int64_t, 1>, Array<std::int64_t, 1>> faces_by_component(
    View<const std::int32_t, 2> neighbours, View<const std::int8_t, 1> orientation);

// The face without a blocked cell that is nearest to the middle of its component, or -1; rims are often
// damaged.
//
// center (N, 2) px; faces (F, 3) cells; members, the component's faces; blocked (N,).
std::int64_t most_central_face(View<const double, 2> center, View<const std::int32_t, 2> faces,
                               View<const std::int64_t, 1> members, View<const bool, 1> blocked);

// The orientation of the brighter faces; 0 if too few lie in the image.
//
// image (H, W, 3) without gaps; center (N, 2) px; faces (F, 3) cells; orientation (F,).
int marker_turn_by_brightness(View<const std::uint8_t, 3> image, View<const double, 2> center,
                              View<const std::int32_t, 2> faces, View<const std::int8_t, 1> orientation,
                              const MarkerTurnLimits& limits);

}  // namespace cmp::numbering
