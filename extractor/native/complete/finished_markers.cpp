#include "complete/finished_markers.hpp"

namespace cmp::complete {

FinishedMarkers finish_markers(const image::PyramidLevel& view, const RefinedMarkers& refined,
                               const refine::StartPlaces& places, const layout::RingTables& tables,
                               const layout::Topology& topology, const SampledCells& cells,
                               const FinishLimits& limits) {
  const ImageSize size{view.image.size(1), view.image.size(0)};
  RepairedMarkers repaired = repair_markers(refined, places, tables, size, limits.repair);
  StripJumps jumps = measure_jumps(refined.xy_px, topology, limits.jumps);
  const auto [figures, noise, edge_px] =
      measure_numbered(view, cells, repaired.xy_px, topology.edges, limits.quality);
  bool are_all_measured = true;
  for (const std::uint8_t status : repaired.status) are_all_measured = are_all_measured && status == MEASURED;
  return {std::move(repaired), std::move(jumps), figures, noise, edge_px, are_all_measured};
}

}  // namespace cmp::complete
