// What the shifts of all markers do to gridlines besides their straight lines: the maps curve the gridlines.
//
// The information about the markers has how a gridline curves with its own two ends. Its other neighbours
// curve it, too, through the maps at its ends; a step without them falls short or overshoots, at the rim by a
// third.
#pragma once

#include "base/array.hpp"
#include "layout/topology.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/solve/fisher_information.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

// What curves the gridlines of a system.
struct CurvedGridlines {
  const layout::Topology& topology;
  View<const double, 2> xy;             // (M, 2) px, the drawn markers, NaN where unknown
  View<const bool, 1> hidden;           // (M,) those that the maps do not use
  View<const double, 2> bend_response;  // (E, 7), as update_without_bending gives it
};

// What is left of the gridlines' gradients after shifts of the markers that curve them.
struct CurvedGradients {
  ShiftGradients left;    // less all that the curving explains
  ShiftGradients others;  // less what it explains beyond the gridlines' own ends, which the information has
};

// The gradients after shifts (M, 2) px, to first order.
CurvedGradients curved_gradients(const GridlineSystem& system, const ShiftGradients& gradients,
                                 const CurvedGridlines& curved, View<const double, 2> shift,
                                 const GridlineLimits& limits);

}  // namespace cmp::refine
