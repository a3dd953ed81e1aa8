#include "refine/refiner.hpp"

#include <cmath>

#include "refine/measure/dot_gain.hpp"

namespace cmp::refine {

namespace {

// Places of the full image in the reduced image, moved inward by the dot gain.
numbering::InitialMarkers places_in_view(const image::PyramidLevel& view, const FirstEstimate& first,
                                         View<const std::int32_t, 2> cells, const DotGainLimits& limits) {
  const StartPlaces& places = first.places;
  Array<double, 2> xy = view.to_level(places.xy_px);
  if (first.dot_gain != 0.0) xy = markers_without_dot_gain(xy, cells, first.dot_gain, limits);
  Array<double, 1> edge(places.edge_px);
  for (double& own : edge) own /= static_cast<double>(view.scale);
  return {std::move(xy), std::move(edge), Array<bool, 1>(places.agreed), Array<bool, 1>(places.is_intact)};
}

// The accepted markers; where the drawing does not explain the image, as in glare, the markers by many
// profiles. `unaccepted` becomes those that the drawing does not explain.
FinalMarkers accepted_or_recovered(const image::PyramidLevel& view, const layout::Topology& topology,
                                   const FirstEstimate& first, const Estimate& after,
                                   const StartPlaces& places, const RefinerLimits& limits) {
  const StepSolution& solution = after.solution;
  FinalMarkers out = accept_markers(
      {solution.measured, solution.reliable, solution.information, after.bend_variance, after.reading.weight,
       after.noise, first.pixel_noise, after.dot_gain, after.convergence_cov_px2},
      places, topology, limits.final);
  update_between_places(out.xy_px, out.cov_px2, after.ink_shift, after.reading.lines, after.drawn.maps,
                        topology, limits.steps.step.ink_shift);
  if (out.all_accepted) return out;
  const auto [xy, hidden, maps] =
      extrapolate_pattern(solution.reliable, topology, limits.steps.step.step.gridlines);
  Array<bool, 1> lost = update_lost_markers(out.xy_px, out.cov_px2, out.unaccepted, xy, places.xy_px,
                                            places.edge_px, limits.final.hidden);
  fill_recovered_markers(view, after.state(xy, hidden, maps), first.contrasts, places, topology,
                         {lost, out.xy_px, out.cov_px2}, limits.recovery);
  out.unaccepted = std::move(lost);
  return out;
}

// Turns markers of the reduced image into those of the full image; a lost one lies where its triangles agree.
void update_to_full_scale(FinalMarkers& markers, const StartPlaces& places, double scale, double deviation) {
  const auto out = markers.xy_px.view();
  const auto out_cov = markers.cov_px2.view();
  const double area = scale * scale;
  for (Index m = 0; m < out.size(); ++m) {
    const bool from_places = std::isnan(out(m, 0)) && places.agreed[m] && std::isfinite(places.xy_px(m, 0));
    for (Index axis = 0; axis < 2; ++axis) {
      out(m, axis) = ((from_places ? places.xy_px(m, axis) : out(m, axis)) + 0.5) * scale - 0.5;
      for (Index other = 0; other < 2; ++other) out_cov(m, axis, other) *= area;
    }
    if (!from_places) continue;
    const double own = deviation * places.edge_px[m];
    out_cov(m, 0, 0) = out_cov(m, 1, 1) = area * (own * own);
    out_cov(m, 0, 1) = out_cov(m, 1, 0) = 0.0;
  }
}

// The parallax of cells of unknown height, a shift of mean 0; nothing where the cells' sizes do not change.
//
// A change of the sizes from one side of the image to the other shows a foot beside the middle.
std::optional<Parallax> unknown_parallax(const UnevenDotGain& change, double width, double height,
                                         const ParallaxLimits& limits) {
  const double slope = std::hypot(change.outward, change.across);
  if (slope == 0.0) return std::nullopt;
  const double foot_px = limits.foot_deviation * width * change.across / slope;
  Parallax out{Array<double, 1>({2}), Array<double, 2>({2, 2}, 0.0), 0.0, limits.unseen * slope};
  out.foot_px[0] = 0.5 * (width - 1.0), out.foot_px[1] = 0.5 * (height - 1.0);
  out.foot_cov_px2(0, 0) = out.foot_cov_px2(1, 1) = foot_px * foot_px;
  return out;
}

// The blur in the full image, px, of a blur in an image at 1/scale of its size: both contain their pixels,
// and a pixel's own variance is a twelfth of its area.
double full_scale_blur(double sigma, double scale) {
  constexpr double OWN_VARIANCE = 1.0 / 12.0;
  const double variance = scale * scale * (sigma * sigma - OWN_VARIANCE) + OWN_VARIANCE;
  return std::sqrt(std::max(variance, OWN_VARIANCE));
}

}  // namespace

RefinedMarkers refined_markers(const image::PyramidLevel& view, const layout::Topology& topology,
                               const FirstEstimate& first, const Schedule& schedule, Index stations,
                               const RefinerLimits& limits) {
  const auto scale = static_cast<double>(view.scale);
  const double height = scale * static_cast<double>(view.image.size(0)),
               width = scale * static_cast<double>(view.image.size(1));
  const numbering::InitialMarkers own =
      places_in_view(view, first, topology.cells, limits.steps.step.dot_gain);
  const StartPlaces places{own.xy_px, own.edge_px, own.agreed, own.is_intact};
  Estimate after = synthesis_steps(view, topology, first, schedule.small_remainder, stations, limits.steps);
  FinalMarkers markers = accepted_or_recovered(view, topology, first, after, places, limits);
  update_to_full_scale(markers, places, scale, limits.agreed_deviation);
  for (bool& explained : markers.unaccepted) explained = !explained;
  return {std::move(markers.xy_px),
          std::move(markers.cov_px2),
          std::move(markers.unaccepted),
          full_scale_blur(after.sigma, scale),
          scale * after.noise,
          {view.scale, after.sigma, after.noise, std::move(after.levels), first.pixel_noise,
           unknown_parallax(after.uneven_dot_gain, width, height, limits.parallax)},
          std::move(after.reading),
          {scale * scale * after.drawn.scatter.variance_px2, after.drawn.scatter.share}};
}

RefinedMarkers refined_again(const image::PyramidLevel& view, const layout::Topology& topology,
                             const StartPlaces& places, const KnownAppearance& known,
                             const Schedule& schedule, Index stations, const RefinerLimits& limits) {
  const FirstEstimateArrays first =
      first_estimate(view, topology, places.xy_px, places, known, schedule.max_profile_rows, limits.first);
  RefinedMarkers out = refined_markers(view, topology, first, schedule, stations, limits);
  if (known.parallax) {
    const auto& [foot, cov, rate, deviation] = *known.parallax;
    out.appearance.parallax = Parallax{Array<double, 1>(foot), Array<double, 2>(cov), rate, deviation};
  }
  return out;
}

}  // namespace cmp::refine
