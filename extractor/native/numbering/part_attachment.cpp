#include "numbering/part_attachment.hpp"

#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "numbering/lattice_motion.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

namespace {

using localmap::MapFrame;
using Map = localmap::LocalMap<3>;

constexpr double MIN_SPREAD = 1e-3;  // of placed cells

// The cells that are placed, with a grid of their places.
class PlacedCells {
 public:
  PlacedCells(const WalkedCells& cells, View<const std::int32_t, 1> cell) {
    for (Index i = 0; i < cell.size(); ++i)
      if (cell[i] >= 0) of_image_.push_back(i);
    xy_ = Array<double, 2>({static_cast<Index>(of_image_.size()), 2});
    for (std::size_t n = 0; n < of_image_.size(); ++n) {
      xy_(n, 0) = cells.centre_px(of_image_[n], 0), xy_(n, 1) = cells.centre_px(of_image_[n], 1);
      of_layout_.push_back(cell[of_image_[n]]);
    }
    if (!of_image_.empty()) grid_.emplace(numeric::bucket_grid(xy_));
  }
  bool is_empty() const { return of_image_.empty(); }
  double x(Index n) const { return xy_(n, 0); }
  double y(Index n) const { return xy_(n, 1); }
  Index of_layout(Index n) const { return of_layout_[n]; }
  Index of_image(Index n) const { return of_image_[n]; }
  double squared_distance(double x, double y) const {
    Array<std::int32_t, 1> index({1});
    Array<double, 1> square({1});
    numeric::fill_nearest_points(*grid_, x, y, index, square);
    return square[0];
  }
  // The placed cells nearest to a place of the image, the nearest first.
  std::vector<Index> nearest(double x, double y, Index count) const {
    Array<std::int32_t, 1> index({count});
    Array<double, 1> square({count});
    const Index found = numeric::fill_nearest_points(*grid_, x, y, index, square);
    return {index.begin(), index.begin() + found};
  }

 private:
  std::vector<Index> of_image_, of_layout_;
  Array<double, 2> xy_;
  std::optional<numeric::BucketGrid> grid_;
};

// The map through the placed cells around a part.
struct Support {
  Map map;
  Map stiff;  // the same with little bending, to look for places across a gap
  double edge_px;
  double misfit;      // of the placed cells alone
  std::int32_t near;  // the layout's cell of the nearest placed cell
};

struct ScoredMotion {
  Motion motion;
  double score;
};

class Attachment {
 public:
  Attachment(const WalkedCells& cells, View<const double, 2> odds, const layout::LayoutCells& layout,
             View<const std::int32_t, 2> axial, View<const std::int32_t, 2> cell_lookup,
             bool with_single_cells, const AttachmentLimits& limits, View<std::int32_t, 1> cell)
      : cells_(cells),
        odds_(odds),
        layout_(layout),
        axial_(axial),
        cell_lookup_(cell_lookup),
        with_single_cells_(with_single_cells),
        limits_(limits),
        cell_(cell),
        is_taken_({layout.ink.size()}, false),
        seen_({layout.ink.size()}, 0) {
    for (Index i = 0; i < cell.size(); ++i)
      if (cell[i] >= 0) is_taken_[cell[i]] = true;
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
    tried_at_.resize(parts_.size(), -1.0);
  }

  // Places parts until none can be placed; single cells are placed where no larger part can be.
  void place_all() {
    for (std::int64_t round = 0; round < limits_.max_rounds; ++round)
      if (!place_some(false) && !(with_single_cells_ && place_some(true))) return;
  }

 private:
  double x(Index i) const { return cells_.centre_px(i, 0); }
  double y(Index i) const { return cells_.centre_px(i, 1); }

  // Places parts, or single cells, beside the placed ones, the nearest first; returns whether any was placed.
  bool place_some(bool is_single) {
    const PlacedCells placed(cells_, cell_);
    if (placed.is_empty()) return false;
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t p = 0; p < parts_.size(); ++p)
      if (!parts_[p].empty() && (parts_[p].size() == 1) == is_single)
        order.push_back({sort_by_distance(parts_[p], placed), p});
    std::sort(order.begin(), order.end());
    bool is_changed = false;
    for (const auto& [distance, p] : order) {
      // only a part beside newly placed cells is tried again
      if (distance == tried_at_[p]) continue;
      tried_at_[p] = distance;
      if (!place(parts_[p], placed)) continue;
      parts_[p].clear();
      is_changed = true;
    }
    return is_changed;
  }

  // Sorts the cells of a part by their distance from placed cells; returns the least.
  double sort_by_distance(std::vector<Index>& part, const PlacedCells& placed) const {
    std::vector<std::pair<double, Index>> order;
    for (const Index i : part) order.push_back({placed.squared_distance(x(i), y(i)), i});
    std::sort(order.begin(), order.end());
    for (std::size_t n = 0; n < part.size(); ++n) part[n] = order[n].second;
    return order.front().first;
  }

  // Places the part by its best motion, if that is certain.
  bool place(const std::vector<Index>& part, const PlacedCells& placed) {
    // the cells of the part that are nearest to its first one
    std::vector<Index> judged(part);
    std::sort(judged.begin(), judged.end(), [&](Index a, Index b) {
      return std::hypot(x(a) - x(part[0]), y(a) - y(part[0])) <
             std::hypot(x(b) - x(part[0]), y(b) - y(part[0]));
    });
    judged.resize(std::min(judged.size(), static_cast<std::size_t>(limits_.judged_cells)));
    const auto support = support_of(judged[0], placed);
    if (!support) return false;
    const auto places = places_near(judged[0], *support);
    // a region in a cell that is placed, or in none, is no cell
    if (part.size() == 1 && is_taken_[places[0]]) return false;
    ScoredMotion best{{}, -1e9}, second = best;
    for (const std::int32_t u : places)
      for (std::int32_t turn = 0; turn < (part.size() == 1 ? 1 : TURNS); ++turn) {
        const Motion motion = motion_to(judged[0], u, turn);
        const double score = score_of(part, judged, *support, motion);
        if (score > best.score) {
          second = best;
          best = {motion, score};
        } else if (score > second.score) {
          second = {motion, score};
        }
      }
    // the cells beside a cut are cut themselves; the best motion must be far better than the second, not
    // perfect
    const double least = -limits_.max_misfit * static_cast<double>(judged.size());
    const double margin = limits_.margin - limits_.margin_of_misfit * best.score;
    if (best.score < least || best.score - second.score < margin) return false;
    for (const Index i : part) {
      const std::int32_t u = moved(i, best.motion);
      if (u < 0 || is_taken_[u]) continue;
      cell_[i] = u;
      is_taken_[u] = true;
    }
    return true;
  }
  std::optional<Support> support_of(Index i, const PlacedCells& placed) const {
    const auto near = placed.nearest(x(i), y(i), limits_.known_cells);
    const Index u = placed.of_layout(near[0]);
    const double edge_px = edge_of(placed.of_image(near[0]));
    const MapFrame frame{layout_.centre_mm(u, 0), layout_.centre_mm(u, 1), layout_.size_mm[u],
                         placed.x(near[0]),       placed.y(near[0]),       edge_px};
    Support out{Map(frame), Map(frame), edge_px, 0.0, static_cast<std::int32_t>(u)};
    for (const Index n : near) {
      const Index v = placed.of_layout(n);
      out.map.add(layout_.centre_mm(v, 0), layout_.centre_mm(v, 1), placed.x(n), placed.y(n));
      out.stiff.add(layout_.centre_mm(v, 0), layout_.centre_mm(v, 1), placed.x(n), placed.y(n));
    }
    if (near.size() < 3 || !out.map.solve(limits_.prior.ridge(1.0), MIN_SPREAD) ||
        !out.stiff.solve(limits_.prior.ridge(limits_.stiffness), MIN_SPREAD))
      return std::nullopt;
    out.misfit = out.map.misfit();
    return out;
  }
  double edge_of(Index i) const {
    const auto corner = cells_.corner_px[i];
    const double ux = corner(1, 0) - corner(0, 0), uy = corner(1, 1) - corner(0, 1);
    const double vx = corner(2, 0) - corner(0, 0), vy = corner(2, 1) - corner(0, 1);
    return std::max(std::sqrt(std::abs(ux * vy - uy * vx) * 2.0 / std::sqrt(3.0)), 1e-3);
  }
  // The layout's cells that may be cell i: those near to its place by the stiff map, the nearest first.
  std::vector<std::int32_t> places_near(Index i, const Support& support) {
    ++search_;
    std::vector<std::pair<double, std::int32_t>> near;
    const auto add = [&](std::int32_t u) {
      if (u < 0 || seen_[u] == search_) return;
      seen_[u] = search_;
      near.push_back({distance_to(support, u, i), u});
    };
    add(support.near);
    double least = near[0].first, reach = reach_at(support, support.near);
    // from cell to cell of the layout, towards the place and around it
    for (std::size_t n = 0; n < near.size(); ++n) {
      const auto [here, u] = near[n];
      if (here < least) least = here, reach = reach_at(support, u);
      if (here > least + reach) continue;
      for (Index k = 0; k < layout_.cell_neighbours.size(1); ++k) add(layout_.cell_neighbours(u, k));
    }
    std::sort(near.begin(), near.end());
    std::vector<std::int32_t> out;
    for (const auto& [here, u] : near)
      if (here <= least + reach) out.push_back(u);
    return out;
  }
  // In edges, how far around a place of the map others are tried.
  double reach_at(const Support& support, std::int32_t u) const {
    const double leverage = support.map.leverage(layout_.centre_mm(u, 0), layout_.centre_mm(u, 1));
    return std::min(limits_.reach,
                    1.0 + limits_.reach_deviations * limits_.prior.noise * std::sqrt(1.0 + leverage));
  }
  // From the place of a layout's cell by the stiff map to a cell of the image, in edges.
  double distance_to(const Support& support, std::int32_t u, Index i) const {
    const auto [px, py] = support.stiff.at(layout_.centre_mm(u, 0), layout_.centre_mm(u, 1));
    return std::hypot(px - x(i), py - y(i)) / support.edge_px;
  }
  Motion motion_to(Index i, std::int32_t u, std::int32_t turn) const {
    const AxialStep turned = turned_up({cells_.axial(i, 0), cells_.axial(i, 1)}, turn);
    return {turn, axial_(u, 0) - turned.q, axial_(u, 1) - turned.r};
  }
  std::int32_t moved(Index i, const Motion& motion) const {
    const AxialStep place = moved_up({cells_.axial(i, 0), cells_.axial(i, 1)}, motion);
    return layout::cell_at(cell_lookup_, place.q, place.r);
  }
  // The log odds of a motion: how much more a map through both sides must bend, and the inks.
  double score_of(const std::vector<Index>& part, const std::vector<Index>& judged, const Support& support,
                  const Motion& motion) const {
    Map map = support.map;
    double score = 0.0;
    for (const Index i : part) {
      const std::int32_t u = moved(i, motion);
      if (u < 0 || is_taken_[u]) score += limits_.outside_odds;
    }
    for (const Index i : judged) {
      const std::int32_t u = moved(i, motion);
      if (u < 0 || is_taken_[u]) continue;
      map.add(layout_.centre_mm(u, 0), layout_.centre_mm(u, 1), x(i), y(i));
      score += odds_(i, layout_.ink[u] - 1);
    }
    if (!map.solve(limits_.prior.ridge(1.0), MIN_SPREAD)) return -1e9;
    for (const Index i : judged) {
      const std::int32_t u = moved(i, motion);
      if (u >= 0 && !is_taken_[u] && !is_pointing(i, u, map, support.edge_px)) score += limits_.outside_odds;
    }
    return score - 0.5 * (map.misfit() - support.misfit) / (limits_.prior.noise * limits_.prior.noise);
  }
  // Whether the triangle points as the layout's cell does by the map.
  bool is_pointing(Index i, std::int32_t u, const Map& map, double edge_px) const {
    std::array<double, 6> expected;
    for (int k = 0; k < 3; ++k) {
      const auto [px, py] = map.at(layout_.centre_mm(u, 0) + layout_.corner_vectors_mm(u, k, 0),
                                   layout_.centre_mm(u, 1) + layout_.corner_vectors_mm(u, k, 1));
      expected[2 * k] = px - x(i), expected[2 * k + 1] = py - y(i);
    }
    for (int first = 0; first < 3; ++first) {
      double most = 0.0;
      for (int k = 0; k < 3; ++k)
        most =
            std::max(most, std::hypot(cells_.corner_px(i, (first + k) % 3, 0) - x(i) - expected[2 * k],
                                      cells_.corner_px(i, (first + k) % 3, 1) - y(i) - expected[2 * k + 1]));
      if (most < limits_.max_corner_misfit * edge_px) return true;
    }
    return false;
  }

  const WalkedCells& cells_;
  View<const double, 2> odds_;
  const layout::LayoutCells& layout_;
  View<const std::int32_t, 2> axial_, cell_lookup_;
  bool with_single_cells_;
  const AttachmentLimits& limits_;
  View<std::int32_t, 1> cell_;
  Array<bool, 1> is_taken_;
  Array<std::int32_t, 1> seen_;  // the search in which a cell of the layout was last seen
  std::int32_t search_ = 0;
  std::vector<std::vector<Index>> parts_;
  std::vector<double>
      tried_at_;  // the squared distance of each part from placed cells when it was last tried
};

}  // namespace

Array<std::int32_t, 1> attach_parts(const WalkedCells& cells, View<const std::int32_t, 1> cell,
                                    View<const double, 2> odds, const layout::LayoutCells& layout,
                                    View<const std::int32_t, 2> axial,
                                    View<const std::int32_t, 2> cell_lookup, bool with_single_cells,
                                    const AttachmentLimits& limits) {
  Array<std::int32_t, 1> out(cell);
  Attachment(cells, odds, layout, axial, cell_lookup, with_single_cells, limits, out).place_all();
  for (Index i = 0; i < out.size(); ++i)
    if (out[i] >= 0 && odds(i, layout.ink[out[i]] - 1) < limits.odd_ink) out[i] = -1;
  return out;
}

}  // namespace cmp::numbering
