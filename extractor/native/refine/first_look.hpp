// The appearance of an image before the first measurement: noise, levels of the inks, contrasts, and blur.
#pragma once

#include <tuple>

#include "base/array.hpp"
#include "image/input.hpp"
#include "image/pyramid.hpp"
#include "layout/topology.hpp"
#include "refine/estimate.hpp"
#include "refine/measure/edge_profiles.hpp"
#include "refine/measure/gridline_weights.hpp"
#include "refine/synthesis/blur_bleed.hpp"
#include "refine/synthesis/ink_levels.hpp"

namespace cmp::refine {

// Limits of the first look.
struct FirstLookLimits {
  double fallback_sigma_px = 0.9;  // the blur where no gridline shows it. Chosen.
  Index blur_gridlines = 60;       // gridlines for the first estimate of the blur. Chosen.
  image::NoiseLimits noise;
  InkLevelLimits levels;
  EdgeProfileLimits profiles;
  BleedLimits bleed;
  GridlineWeightLimits weights;
};

// The noise, gray levels, and the fields of InkLevels.
using FirstAppearance = std::tuple<double, LevelArrays>;
struct ContrastArrays {
  Array<double, 2> sides, contrasts, clearance;  // as in EdgeContrasts

  CMP_RECORD("extractor.refine.estimate.EdgeContrasts", sides, contrasts, clearance)
};
// The blur, px; and the bleed of each cell (K,) and its median, as bleed_shares gives them.
using BlurAndBleed = std::tuple<double, Array<double, 1>, double>;

// The noise, and the levels from the middles of the cells at the markers xy (M, 2) px; sigma px, the assumed
// blur.
FirstAppearance initial_appearance(const image::PyramidLevel& view, const layout::Topology& topology,
                                   View<const double, 2> xy, double sigma, const FirstLookLimits& limits);

// The contrasts across the gridlines (E, 8); those beside unknown cells are marked as not known in `lines`.
ContrastArrays edge_contrasts(View<double, 2> lines, View<const double, 2> xy,
                              const layout::Topology& topology, const InkLevels& levels,
                              const image::PyramidLevel& view, const FirstLookLimits& limits);

// The blur that some of the gridlines (E, 8) show, and the bleed; assumed px, the blur of the levels' discs.
BlurAndBleed blur_and_bleed(const image::PyramidLevel& view, View<const double, 2> lines,
                            const EdgeContrasts& across, View<const double, 2> xy,
                            View<const std::int32_t, 2> cells, double assumed, const FirstLookLimits& limits);

}  // namespace cmp::refine
