#include "numbering/part_attachment.hpp"

#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "numbering/lattice_motion.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

namespace {

using localmap::LocalMap;
using localmap::MappedPoint;

// A motion of a part with its score.
struct ScoredMotion {
  Motion motion;
  double score;
};

// The cells that are placed, with a grid of their places.
class PlacedCells {
 public:
  PlacedCells(const WalkedCells& cells, View<const std::int32_t, 1> cell, const layout::LayoutCells& layout,
              const AttachmentLimits& limits)
      : layout_(layout), limits_(limits) {
    for (Index i = 0; i < cell.size(); ++i)
      if (cell[i] >= 0) of_image_.push_back(i);
    xy_ = Array<double, 2>({static_cast<Index>(of_image_.size()), 2});
    for (std::size_t n = 0; n < of_image_.size(); ++n) {
      xy_(n, 0) = cells.center_px(of_image_[n], 0), xy_(n, 1) = cells.center_px(of_image_[n], 1);
      of_layout_.push_back(cell[of_image_[n]]);
    }
    if (!of_image_.empty()) grid_.emplace(numeric::bucket_grid(xy_));
  }
  bool is_empty() const { return of_image_.empty(); }
  double squared_distance(double x, double y) const {
    Array<std::int32_t, 1> index({1});
    Array<double, 1> square({1});
    numeric::fill_nearest_points(*grid_, x, y, index, square);
    return square[0];
  }

  // The map through the placed cells nearest to a place of the image.
  struct Support {
    LocalMap map;
    std::vector<Index> of_layout;  // the cells of the layout, the nearest first
  };
  std::optional<Support> support(double x, double y) const {
    Array<std::int32_t, 1> index({limits_.known_cells});
    Array<double, 1> square({limits_.known_cells});
    const Index count = numeric::fill_nearest_points(*grid_, x, y, index, square);
    const Index first = of_layout_[index[0]];
    Support out{LocalMap(layout_.center_mm(first, 0), layout_.center_mm(first, 1), layout_.size_mm[first],
                         limits_.prior),
                {}};
    for (Index k = 0; k < count; ++k) {
      const Index u = of_layout_[index[k]];
      out.map.add(layout_.center_mm(u, 0), layout_.center_mm(u, 1), xy_(index[k], 0), xy_(index[k], 1));
      out.of_layout.push_back(u);
    }
    if (!out.map.solve()) return std::nullopt;
    return out;
  }

 private:
  const layout::LayoutCells& layout_;
  const AttachmentLimits& limits_;
  std::vector<Index> of_image_, of_layout_;
  Array<double, 2> xy_;
  std::optional<numeric::BucketGrid> grid_;
};

class Attachment {
 public:
  Attachment(const WalkedCells& cells, View<const double, 2> odds, const layout::LayoutCells& layout,
             View<const std::int32_t, 2> axial, View<const std::int32_t, 2> cell_lookup, const AttachmentLimits& limits,
             View<std::int32_t, 1> cell)
      : cells_(cells), odds_(odds), layout_(layout), axial_(axial), cell_lookup_(cell_lookup), limits_(limits), cell_(cell),
        taken_({layout.ink.size()}, false) {
    for (Index i = 0; i < cell.size(); ++i)
      if (cell[i] >= 0) taken_[cell[i]] = true;
    std::map<std::int32_t, std::size_t> number;
    for (Index i = 0; i < cell.size(); ++i) {
      if (cell[i] >= 0) continue;
      if (cells.part[i] < 0) {
        parts_.push_back({i});
        continue;
      }
      const auto [found, is_new] = number.try_emplace(cells.part[i], parts_.size());
      if (is_new) parts_.emplace_back();
      parts_[found->second].push_back(i);
    }
  }

  // Places parts, the nearest first, until none can be placed.
  void place_all() {
    for (std::int64_t round = 0; round < limits_.max_rounds; ++round) {
      const PlacedCells placed(cells_, cell_, layout_, limits_);
      if (placed.is_empty()) return;
      std::vector<std::pair<double, std::size_t>> order;
      for (std::size_t p = 0; p < parts_.size(); ++p)
        if (!parts_[p].empty()) order.push_back({sort_by_distance(parts_[p], placed), p});
      std::sort(order.begin(), order.end());
      bool is_changed = false;
      for (const auto& [distance, p] : order)
        if (place(parts_[p], placed)) {
          parts_[p].clear();
          is_changed = true;
        }
      if (!is_changed) return;
    }
  }

 private:
  // Sorts the cells of a part by their distance from placed cells; returns the least.
  double sort_by_distance(std::vector<Index>& part, const PlacedCells& placed) const {
    std::vector<std::pair<double, Index>> order;
    for (const Index i : part)
      order.push_back({placed.squared_distance(cells_.center_px(i, 0), cells_.center_px(i, 1)), i});
    std::sort(order.begin(), order.end());
    for (std::size_t n = 0; n < part.size(); ++n) part[n] = order[n].second;
    return order.front().first;
  }

  // Places the part by its best motion, if that is certain.
  bool place(const std::vector<Index>& part, const PlacedCells& placed) {
    const std::size_t judged = std::min(part.size(), static_cast<std::size_t>(limits_.judged_cells));
    std::vector<PlacedCells::Support> supports;
    for (std::size_t n = 0; n < judged; ++n) {
      auto support = placed.support(cells_.center_px(part[n], 0), cells_.center_px(part[n], 1));
      if (!support) return false;
      supports.push_back(std::move(*support));
    }
    ScoredMotion best{{}, -1e9}, second = best;
    for (const std::int32_t u : places_near(part[0], supports[0]))
      for (std::int32_t turn = 0; turn < (part.size() == 1 ? 1 : TURNS); ++turn) {
        const Motion motion = motion_to(part[0], u, turn);
        const double score = score_of(part, supports, motion);
        if (score > best.score) {
          second = best;
          best = {motion, score};
        } else if (score > second.score) {
          second = {motion, score};
        }
      }
    const double least = -limits_.max_misfit * static_cast<double>(judged);
    if (best.score < least || best.score - second.score < limits_.margin) return false;
    for (const Index i : part) {
      const std::int32_t u = moved(i, best.motion);
      if (u < 0 || taken_[u]) continue;
      cell_[i] = u;
      taken_[u] = true;
    }
    return true;
  }
  // The layout's cells that may be cell i: those near to its place by the map.
  std::vector<std::int32_t> places_near(Index i, const PlacedCells::Support& support) const {
    const double x = cells_.center_px(i, 0), y = cells_.center_px(i, 1);
    std::vector<std::int32_t> near;
    std::vector<bool> is_seen(static_cast<std::size_t>(layout_.ink.size()), false);
    std::vector<std::int32_t> waiting{static_cast<std::int32_t>(support.of_layout[0])};
    is_seen[waiting[0]] = true;
    double least = distance_to(support, waiting[0], x, y);
    // from cell to cell of the layout, towards the place and around it
    for (std::size_t n = 0; n < waiting.size(); ++n) {
      const double here = distance_to(support, waiting[n], x, y);
      if (here > least + limits_.reach) continue;
      least = std::min(least, here);
      near.push_back(waiting[n]);
      for (Index k = 0; k < layout_.cell_neighbours.size(1); ++k) {
        const std::int32_t next = layout_.cell_neighbours(waiting[n], k);
        if (next < 0 || is_seen[next]) continue;
        is_seen[next] = true;
        waiting.push_back(next);
      }
    }
    std::vector<std::int32_t> out;
    for (const std::int32_t u : near)
      if (distance_to(support, u, x, y) <= least + limits_.reach) out.push_back(u);
    return out;
  }
  // From the place of a layout's cell by the map to a place of the image, in edges.
  double distance_to(const PlacedCells::Support& support, std::int32_t u, double x, double y) const {
    const MappedPoint point = support.map.at(layout_.center_mm(u, 0), layout_.center_mm(u, 1), 0.0);
    const double edge = std::sqrt(std::abs(point.xx * point.yy - point.xy * point.yx)) * layout_.size_mm[u];
    return std::hypot(point.x - x, point.y - y) / std::max(edge, 1e-6);
  }
  Motion motion_to(Index i, std::int32_t u, std::int32_t turn) const {
    const AxialStep turned = turned_up({cells_.axial(i, 0), cells_.axial(i, 1)}, turn);
    return {turn, axial_(u, 0) - turned.q, axial_(u, 1) - turned.r};
  }
  std::int32_t moved(Index i, const Motion& motion) const {
    const AxialStep place = moved_up({cells_.axial(i, 0), cells_.axial(i, 1)}, motion);
    return layout::cell_at(cell_lookup_, place.q, place.r);
  }
  // The log likelihood of a motion: misfits of the cells nearest to placed ones, and their inks.
  double score_of(const std::vector<Index>& part, const std::vector<PlacedCells::Support>& supports,
                  const Motion& motion) const {
    double score = 0.0;
    for (std::size_t n = 0; n < supports.size(); ++n) {
      const std::int32_t u = moved(part[n], motion);
      score += u < 0 || taken_[u] ? limits_.outside_odds : cell_score(part[n], u, supports[n]);
    }
    return score;
  }
  double cell_score(Index i, std::int32_t u, const PlacedCells::Support& support) const {
    double nearest2 = 1e9;
    for (const Index v : support.of_layout) {
      const double x = layout_.center_mm(u, 0) - layout_.center_mm(v, 0), y = layout_.center_mm(u, 1) - layout_.center_mm(v, 1);
      nearest2 = std::min(nearest2, (x * x + y * y) / (layout_.size_mm[u] * layout_.size_mm[u]));
    }
    const MappedPoint point = support.map.at(layout_.center_mm(u, 0), layout_.center_mm(u, 1), std::sqrt(nearest2));
    const double dx = point.x - cells_.center_px(i, 0), dy = point.y - cells_.center_px(i, 1);
    const double square = (dx * dx + dy * dy) / point.variance;
    // a smaller variance counts for a motion as much as a smaller misfit
    const double fit = -0.5 * square - std::log(std::max(point.variance, 1e-9) / unit_variance(point, u));
    return std::max(fit + odds_(i, layout_.ink[u] - 1) + corner_score(i, u, point), limits_.outside_odds);
  }
  double unit_variance(const MappedPoint& point, std::int32_t u) const {
    const double edge2 = std::abs(point.xx * point.yy - point.xy * point.yx) * layout_.size_mm[u] * layout_.size_mm[u];
    return limits_.prior.noise * limits_.prior.noise * std::max(edge2, 1e-9);
  }
  // The triangle must point as the layout's cell does.
  double corner_score(Index i, std::int32_t u, const MappedPoint& point) const {
    const double edge = std::sqrt(std::abs(point.xx * point.yy - point.xy * point.yx)) * layout_.size_mm[u];
    double least = 1e9;
    for (int first = 0; first < 3; ++first) {
      double most = 0.0;
      for (int k = 0; k < 3; ++k) {
        const double x = layout_.corner_vectors_mm(u, k, 0), y = layout_.corner_vectors_mm(u, k, 1);
        const double dx = cells_.corner_px(i, (first + k) % 3, 0) - cells_.center_px(i, 0) - point.xx * x - point.xy * y;
        const double dy = cells_.corner_px(i, (first + k) % 3, 1) - cells_.center_px(i, 1) - point.yx * x - point.yy * y;
        most = std::max(most, std::hypot(dx, dy) / std::max(edge, 1e-6));
      }
      least = std::min(least, most);
    }
    return least > limits_.max_corner_misfit ? limits_.outside_odds : 0.0;
  }

  const WalkedCells& cells_;
  View<const double, 2> odds_;
  const layout::LayoutCells& layout_;
  View<const std::int32_t, 2> axial_, cell_lookup_;
  const AttachmentLimits& limits_;
  View<std::int32_t, 1> cell_;
  Array<bool, 1> taken_;
  std::vector<std::vector<Index>> parts_;
};

}  // namespace

Array<std::int32_t, 1> attach_parts(const WalkedCells& cells, View<const std::int32_t, 1> cell,
                                    View<const double, 2> odds, const layout::LayoutCells& layout,
                                    View<const std::int32_t, 2> axial, View<const std::int32_t, 2> cell_lookup,
                                    const AttachmentLimits& limits) {
  Array<std::int32_t, 1> out(cell);
  Attachment(cells, odds, layout, axial, cell_lookup, limits, out).place_all();
  return out;
}

}  // namespace cmp::numbering
