#include "complete/finished_markers.hpp"

namespace cmp::complete {

namespace {

// Moves markers into the plane of the black.
void update_without_parallax(RepairedMarkers& markers, const refine::KnownParallax& parallax) {
  const double rate2 = parallax.rate * parallax.rate,
               deviation2 = parallax.rate_deviation * parallax.rate_deviation;
  for (Index m = 0; m < markers.xy_px.size(); ++m) {
    const std::array<double, 2> away{markers.xy_px(m, 0) - parallax.foot_px[0],
                                     markers.xy_px(m, 1) - parallax.foot_px[1]};
    for (Index i = 0; i < 2; ++i) {
      markers.xy_px(m, i) -= parallax.rate * away[i];
      for (Index j = 0; j < 2; ++j) {
        markers.cov_px2(m, i, j) +=
            deviation2 * away[i] * away[j] + (deviation2 + rate2) * parallax.foot_cov_px2(i, j);
      }
    }
  }
}

}  // namespace

FinishedMarkers finish_markers(const image::PyramidLevel& view, const RefinedMarkers& refined,
                               const refine::StartPlaces& places, const layout::RingTables& tables,
                               const layout::Topology& topology, const SampledCells& cells,
                               const FinishLimits& limits) {
  const ImageSize size{view.image.size(1), view.image.size(0)};
  RepairedMarkers repaired = repair_markers(refined, places, tables, size, limits.repair);
  StripJumps jumps = measure_jumps(refined.xy_px, topology, limits.jumps);
  const auto [figures, noise, edge_px] =
      measure_numbered(view, cells, repaired.xy_px, topology.edges, limits.quality);
  if (refined.appearance.parallax) update_without_parallax(repaired, *refined.appearance.parallax);
  bool are_all_measured = true;
  for (const std::uint8_t status : repaired.status) are_all_measured = are_all_measured && status == MEASURED;
  return {std::move(repaired), std::move(jumps), figures, noise, edge_px, are_all_measured};
}

}  // namespace cmp::complete
