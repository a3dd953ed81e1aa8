#include "numbering/gaps/gap_check.hpp"

#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "numbering/mesh_parts.hpp"
#include "numeric/median.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::numbering {

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr Index COMPARED_CELLS = 3;  // consistent cells with which each cell is compared

double squared(double value) { return value * value; }

// Which of N numbered cells are consistent.
struct Consistency {
  View<const std::int32_t, 1> cell;  // (N,) the layout's cell of each cell of the image, or -1
  Array<bool, 1> is_consistent;      // (N,)
  Array<double, 3> slope;            // (N, 2, 2) px per mm, the local linear maps
  Array<bool, 1> has_slope;          // (N,)
};

// The consistent cells with a slope, with which others are compared.
struct Support {
  Array<std::int64_t, 1> cells;
  Array<double, 2> points;  // their centers, px
  numeric::BucketGrid grid;

  Index size() const { return cells.size(); }
};

// The indices of the support cells nearest to a cell, and their squared distances, px^2.
struct NearestSupport {
  std::array<std::int32_t, COMPARED_CELLS> index;
  std::array<double, COMPARED_CELLS> square;
};

// The largest block of those of the cells nearest to the white one.
std::int32_t reference_block(View<const double, 2> center, View<const std::int32_t, 1> block,
                             View<const std::int64_t, 1> sizes, View<const double, 1> white_px,
                             Index candidates) {
  Array<double, 1> squares({candidates});
  Array<std::int32_t, 1> blocks({candidates});
  Index found = 0;
  for (Index i = 0; i < block.size(); ++i) {
    if (block[i] < 0) continue;
    const double square = squared(center(i, 0) - white_px[0]) + squared(center(i, 1) - white_px[1]);
    Index at = std::min(found, candidates - 1);
    if (found == candidates && square >= squares[at]) continue;
    for (; at > 0 && squares[at - 1] > square; --at) {
      squares[at] = squares[at - 1];
      blocks[at] = blocks[at - 1];
    }
    squares[at] = square;
    blocks[at] = block[i];
    found = std::min(found + 1, candidates);
  }
  std::int32_t best = blocks[0];
  for (Index k = 1; k < found; ++k) best = sizes[blocks[k]] > sizes[best] ? blocks[k] : best;
  return best;
}

// Writes the slope (2, 2), px per mm, at cell i by the cells in contact; false where these lie on one line.
bool fill_slope(Index i, View<const double, 2> center, View<const std::int32_t, 1> cell,
                View<const std::int32_t, 1> neighbours, View<const double, 2> center_mm, double min_spread,
                View<double, 2> out) {
  double xx = 0.0, xy = 0.0, yy = 0.0, ax = 0.0, ay = 0.0, bx = 0.0, by = 0.0;
  Index count = 0;
  for (const std::int32_t j : neighbours) {
    if (j < 0) continue;
    const double x = center_mm(cell[j], 0) - center_mm(cell[i], 0),
                 y = center_mm(cell[j], 1) - center_mm(cell[i], 1);
    const double px = center(j, 0) - center(i, 0), py = center(j, 1) - center(i, 1);
    xx += x * x;
    xy += x * y;
    yy += y * y;
    ax += px * x;
    ay += px * y;
    bx += py * x;
    by += py * y;
    ++count;
  }
  const double determinant = xx * yy - xy * xy;
  if (count < 2 || determinant < min_spread * squared(xx + yy)) return false;
  out(0, 0) = (ax * yy - ay * xy) / determinant;
  out(0, 1) = (ay * xx - ax * xy) / determinant;
  out(1, 0) = (bx * yy - by * xy) / determinant;
  out(1, 1) = (by * xx - bx * xy) / determinant;
  return true;
}

// The median of COMPARED_CELLS numbers; NaN if any is NaN.
double median_of_three(double a, double b, double c) {
  if (std::isnan(a) || std::isnan(b) || std::isnan(c)) return NOT_A_NUMBER;
  return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

// The comparison of detached cells with the consistent ones.
class Comparison {
 public:
  Comparison(const Contacts& contacts, const GapCheckLimits& limits, Consistency& state)
      : contacts_(contacts), limits_(limits), state_(state), center_(contacts.cells.center_px) {}

  // Accepts the consistent blocks, the nearest first; block (N,), or -1.
  void update_blocks(View<const std::int32_t, 1> block, Index blocks) {
    Array<double, 1> jumps({block.size()}), gap({block.size()}), least({blocks});
    Array<bool, 1> refused({blocks}, false), is_waiting({block.size()});
    while (true) {
      for (Index i = 0; i < block.size(); ++i)
        is_waiting[i] = block[i] >= 0 && !state_.is_consistent[i] && !refused[block[i]];
      const Array<std::int64_t, 1> waiting = numbers_of(is_waiting);
      Array<std::int64_t, 1> cells = support_cells();
      if (waiting.size() == 0 || cells.size() < COMPARED_CELLS) break;
      const Support support = support_of(std::move(cells));
      fill_gaps(block, waiting, support, gap, least);
      const double nearest_of_all = *std::min_element(least.begin(), least.end());
      if (!(nearest_of_all < limits_.max_gap)) break;
      for (Index b = 0; b < blocks; ++b) {
        if (least[b] > limits_.max_gap_ratio * nearest_of_all) continue;
        const double max_gap = limits_.max_gap_ratio * least[b];
        Index count = 0;
        for (const Index j : waiting.view()) {
          if (block[j] != b || gap[j] > max_gap) continue;
          const double jump = update_slope_and_measure_jump(j, support, nearest_to(j, support));
          if (std::isfinite(jump)) jumps[count++] = jump;
        }
        if (is_similar(jumps.slice(0, count)))
          accept(block, b);
        else
          refused[b] = true;
      }
    }
  }

  // Accepts the consistent ones of the cells without contacts.
  void update_singles(View<const std::int64_t, 1> singles) {
    Array<std::int64_t, 1> cells = support_cells();
    if (cells.size() < COMPARED_CELLS) return;
    const Support support = support_of(std::move(cells));
    for (const Index j : singles) {
      const NearestSupport nearest = nearest_to(j, support);
      const double jump = update_slope_and_measure_jump(j, support, nearest);
      const double edge = equilateral_edge(contacts_.cells.area_px[support.cells[nearest.index[0]]]);
      state_.is_consistent[j] =
          jump < limits_.max_single_jump && std::sqrt(nearest.square[0]) < limits_.max_gap * edge;
    }
  }

 private:
  Array<std::int64_t, 1> support_cells() const {
    Array<bool, 1> selected({state_.is_consistent.size()});
    for (Index i = 0; i < selected.size(); ++i) selected[i] = state_.is_consistent[i] && state_.has_slope[i];
    return numbers_of(selected);
  }

  Support support_of(Array<std::int64_t, 1> cells) const {
    Array<double, 2> points = selected_points(center_, cells);
    numeric::BucketGrid grid = numeric::bucket_grid(points);
    return {std::move(cells), std::move(points), std::move(grid)};
  }

  NearestSupport nearest_to(Index j, const Support& support) const {
    NearestSupport out;
    numeric::fill_nearest_points(support.grid, center_(j, 0), center_(j, 1),
                                 {out.index.data(), {COMPARED_CELLS}}, {out.square.data(), {COMPARED_CELLS}});
    return out;
  }

  // Writes the gaps (N,), in cells, of the waiting cells from the support, and each block's least.
  void fill_gaps(View<const std::int32_t, 1> block, View<const std::int64_t, 1> waiting,
                 const Support& support, View<double, 1> gap, View<double, 1> least) const {
    least.fill(INFINITE);
    for (const Index j : waiting) {
      std::int32_t nearest = 0;
      double square = 0.0;
      numeric::fill_nearest_points(support.grid, center_(j, 0), center_(j, 1), {&nearest, {1}},
                                   {&square, {1}});
      gap[j] = std::sqrt(square) / equilateral_edge(contacts_.cells.area_px[support.cells[nearest]]);
      least[block[j]] = std::min(least[block[j]], gap[j]);
    }
  }

  // Whether most of a block's jumps are small; their order is changed.
  bool is_similar(View<double, 1> jumps) const {
    if (jumps.size() == 0) return false;
    const double limit = limits_.max_median_jump;
    const auto large =
        std::count_if(jumps.begin(), jumps.end(), [limit](double jump) { return jump > limit; });
    return numeric::median_of_many(jumps) < limit &&
           static_cast<double>(large) <= limits_.max_jump_share * static_cast<double>(jumps.size());
  }

  void accept(View<const std::int32_t, 1> block, Index b) {
    for (Index i = 0; i < block.size(); ++i) {
      if (block[i] == b) state_.is_consistent[i] = true;
    }
  }

  // The median jump, in cells, of cell j against the nearest support cells.
  //
  // A cell without a slope is given the one of its triangle, else that of the nearest cell, and keeps it.
  double update_slope_and_measure_jump(Index j, const Support& support, const NearestSupport& nearest) {
    const auto center_mm = contacts_.layout.center_mm;
    const auto cell = state_.cell;
    const auto slope = state_.slope.view();
    if (!state_.has_slope[j]) {
      const auto like = slope[support.cells[nearest.index[0]]];
      if (fill_map_by_similarity(contacts_, j, cell[j], like, slope[j]) < 0) copy<double, 2>(like, slope[j]);
      state_.has_slope[j] = true;
    }
    std::array<double, COMPARED_CELLS> jump;
    for (Index k = 0; k < COMPARED_CELLS; ++k) {
      const Index i = support.cells[nearest.index[k]];
      const double a = 0.5 * (slope(i, 0, 0) + slope(j, 0, 0)), b = 0.5 * (slope(i, 0, 1) + slope(j, 0, 1));
      const double c = 0.5 * (slope(i, 1, 0) + slope(j, 1, 0)), d = 0.5 * (slope(i, 1, 1) + slope(j, 1, 1));
      const double determinant = a * d - b * c;
      const double x = center_(j, 0) - center_(i, 0), y = center_(j, 1) - center_(i, 1);
      const double dx = (d * x - b * y) / determinant - center_mm(cell[j], 0) + center_mm(cell[i], 0);
      const double dy = (a * y - c * x) / determinant - center_mm(cell[j], 1) + center_mm(cell[i], 1);
      jump[k] = std::hypot(dx, dy) / contacts_.layout.size_mm[cell[j]];
    }
    return median_of_three(jump[0], jump[1], jump[2]);
  }

  const Contacts& contacts_;
  const GapCheckLimits& limits_;
  Consistency& state_;
  View<const double, 2> center_;
};

// The jump, in cells, of cell b against the slope by the contacts of cell a with others; 0 without a slope.
double contact_jump(const Contacts& contacts, View<const std::int32_t, 1> cell,
                    View<const std::int32_t, 1> neighbours, Index a, Index b, double min_spread) {
  const auto center = contacts.cells.center_px, center_mm = contacts.layout.center_mm;
  Array<std::int32_t, 1> others(neighbours);
  std::replace(others.view().begin(), others.view().end(), static_cast<std::int32_t>(b), -1);
  Array<double, 2> slope({2, 2});
  if (!fill_slope(a, center, cell, others, center_mm, min_spread, slope)) return 0.0;
  const auto s = slope.view();
  const double x_mm = center_mm(cell[b], 0) - center_mm(cell[a], 0),
               y_mm = center_mm(cell[b], 1) - center_mm(cell[a], 1);
  const double dx = center(b, 0) - center(a, 0) - s(0, 0) * x_mm - s(0, 1) * y_mm;
  const double dy = center(b, 1) - center(a, 1) - s(1, 0) * x_mm - s(1, 1) * y_mm;
  const double size = std::sqrt(std::abs(s(0, 0) * s(1, 1) - s(0, 1) * s(1, 0)));
  return std::hypot(dx, dy) / (size * contacts.layout.size_mm[cell[b]]);
}

// The contacts (N, 6) of which both cells are in contact with a third one, and that lie where the other
// contacts of both cells predict them, else -1.
//
// Across a gap a shifted center may bring a wrong pair near enough. All cells along a gap of about one cell
// may be so near, but not as near as neighbours are.
Array<std::int32_t, 2> firm_contacts(const Contacts& contacts, View<const std::int32_t, 1> cell,
                                     View<const std::int32_t, 2> neighbours, const GapCheckLimits& limits) {
  Array<std::int32_t, 2> out(neighbours);
  const auto is_even = [&](Index a, Index b) {
    return contact_jump(contacts, cell, neighbours[a], a, b, limits.min_slope_spread) <
           limits.max_contact_jump;
  };
  const Index sides = neighbours.size(1);
  for (Index i = 0; i < neighbours.size(); ++i)
    for (Index k = 0; k < sides; ++k) {
      const std::int32_t j = neighbours(i, k);
      if (j < 0) continue;
      const std::int32_t after = neighbours(i, (k + 1) % sides),
                         before = neighbours(i, (k + sides - 1) % sides);
      const auto touches = neighbours[j];
      const bool is_firm = std::any_of(touches.begin(), touches.end(), [=](std::int32_t third) {
        return third >= 0 && (third == after || third == before);
      });
      if (!is_firm || !is_even(i, j) || !is_even(j, i)) out(i, k) = -1;
    }
  return out;
}

// The number of cells in each block.
Array<std::int64_t, 1> block_sizes(View<const std::int32_t, 1> block) {
  const std::int32_t last = block.size() > 0 ? *std::max_element(block.begin(), block.end()) : -1;
  Array<std::int64_t, 1> sizes({last + 1}, 0);
  for (const std::int32_t b : block) {
    if (b >= 0) ++sizes[b];
  }
  return sizes;
}

// The block that another one became part of.
std::int32_t root_of(View<const std::int32_t, 1> parent, std::int32_t block) {
  while (parent[block] != block) block = parent[block];
  return block;
}

// Two blocks, and how many contacts that are not firm lead from one to the other.
struct LooseContacts {
  std::int32_t a, b;
  Index count;
};

// The loose contacts between blocks, the most numerous first.
std::vector<LooseContacts> loose_contacts(View<const std::int32_t, 2> neighbours,
                                          View<const std::int32_t, 1> block) {
  std::map<std::pair<std::int32_t, std::int32_t>, Index> counts;
  for (Index i = 0; i < neighbours.size(); ++i)
    for (const std::int32_t j : neighbours[i])
      if (j >= 0 && block[i] >= 0 && block[i] < block[j]) ++counts[{block[i], block[j]}];
  std::vector<LooseContacts> out;
  for (const auto& [pair, count] : counts) out.push_back({pair.first, pair.second, count});
  std::stable_sort(out.begin(), out.end(),
                   [](const auto& one, const auto& other) { return one.count > other.count; });
  return out;
}

// (N,) the blocks of selected cells: joined by firm contacts, and by others unless both parts hold a large
// block.
Array<std::int32_t, 1> blocks_of(const Contacts& contacts, View<const std::int32_t, 1> cell,
                                 View<const std::int32_t, 2> neighbours, View<const bool, 1> selected,
                                 const GapCheckLimits& limits) {
  Array<std::int32_t, 1> block =
      connected_components(firm_contacts(contacts, cell, neighbours, limits), selected);
  const Array<std::int64_t, 1> sizes = block_sizes(block);
  const auto total = static_cast<double>(std::count(selected.begin(), selected.end(), true));
  const double large = std::max(static_cast<double>(limits.min_block_cells), limits.min_block_share * total);
  Array<std::int32_t, 1> parent({sizes.size()}), number({sizes.size()}, -1);
  Array<bool, 1> is_large({sizes.size()});
  for (Index b = 0; b < sizes.size(); ++b) {
    parent[b] = static_cast<std::int32_t>(b);
    is_large[b] = static_cast<double>(sizes[b]) >= large;
  }
  for (const LooseContacts& one : loose_contacts(neighbours, block)) {
    const std::int32_t a = root_of(parent, one.a), b = root_of(parent, one.b);
    if (a == b || (is_large[a] && is_large[b])) continue;
    parent[a] = b;
    is_large[b] = is_large[a] || is_large[b];
  }
  std::int32_t count = 0;
  for (std::int32_t& own : block.view()) {
    if (own < 0) continue;
    const std::int32_t root = root_of(parent, own);
    if (number[root] < 0) number[root] = count++;
    own = number[root];
  }
  return block;
}

}  // namespace

Array<bool, 1> consistent_cells(const Contacts& contacts, View<const std::int32_t, 1> cell,
                                View<const double, 1> white_px, View<const std::int32_t, 2> neighbours,
                                const GapCheckLimits& limits) {
  const Index count = cell.size();
  const auto center = contacts.cells.center_px;
  Array<bool, 1> selected({count});
  for (Index i = 0; i < count; ++i) selected[i] = contacts.cells.is_intact[i] && cell[i] >= 0;
  const Array<std::int32_t, 1> block = blocks_of(contacts, cell, neighbours, selected, limits);
  Array<std::int64_t, 1> sizes = block_sizes(block);
  if (sizes.size() == 0) return Array<bool, 1>({count}, false);
  const Index largest = std::max_element(sizes.begin(), sizes.end()) - sizes.begin();
  const Index reference = std::isnan(white_px[0])
                              ? largest
                              : reference_block(center, block, sizes, white_px, limits.reference_candidates);
  Consistency state{cell, Array<bool, 1>({count}), Array<double, 3>({count, 2, 2}, NOT_A_NUMBER),
                    Array<bool, 1>({count}, false)};
  for (Index i = 0; i < count; ++i) {
    state.is_consistent[i] = block[i] == reference;
    selected[i] = cell[i] >= 0 && block[i] < 0;
  }
  const Array<std::int64_t, 1> singles = numbers_of(selected);
  if (sizes.size() == 1 && singles.size() == 0) return std::move(state.is_consistent);
  for (Index i = 0; i < count; ++i) {
    if (block[i] < 0) continue;
    state.has_slope[i] = fill_slope(i, center, cell, neighbours[i], contacts.layout.center_mm,
                                    limits.min_slope_spread, state.slope.view()[i]);
  }
  Comparison comparison(contacts, limits, state);
  if (sizes.size() > 1) comparison.update_blocks(block, sizes.size());
  if (singles.size() > 0) comparison.update_singles(singles);
  return std::move(state.is_consistent);
}

bool is_white_cell_contradicted(View<const double, 2> center, View<const bool, 1> is_intact,
                                View<const std::int32_t, 1> cell, View<const double, 1> white_px,
                                View<const double, 1> white_mm, const layout::LayoutCells& layout,
                                const GapCheckLimits& limits) {
  Array<bool, 1> selected({cell.size()});
  for (Index i = 0; i < cell.size(); ++i) selected[i] = cell[i] >= 0 && is_intact[i];
  const Array<std::int64_t, 1> known = numbers_of(selected);
  if (known.size() < limits.min_white_cell_neighbours) return false;
  const Array<std::int32_t, 1> image_cell = localmap::image_cell_of_layout_cell(cell, layout.ink.size());
  const Array<double, 3> slope = localmap::linear_maps(center, cell, image_cell, layout, limits.contact.maps);
  Array<std::int32_t, 1> index({limits.white_cell_neighbours});
  Array<double, 1> square({limits.white_cell_neighbours}), misfit({limits.white_cell_neighbours});
  const Array<double, 2> points = selected_points(center, known);
  const numeric::BucketGrid grid = numeric::bucket_grid(points);
  const Index found = numeric::fill_nearest_points(grid, white_px[0], white_px[1], index, square);
  Index count = 0;
  for (Index k = 0; k < found; ++k) {
    const Index i = known[index[k]];
    const double a = slope(i, 0, 0), b = slope(i, 0, 1), c = slope(i, 1, 0), d = slope(i, 1, 1);
    const double size = layout.size_mm[cell[i]] * std::sqrt(std::abs(a * d - b * c));
    if (!(square[k] < squared(limits.max_gap * size))) continue;
    const double x = white_mm[0] - layout.center_mm(cell[i], 0),
                 y = white_mm[1] - layout.center_mm(cell[i], 1);
    const double dx = center(i, 0) + a * x + b * y - white_px[0],
                 dy = center(i, 1) + c * x + d * y - white_px[1];
    misfit[count++] = std::sqrt(dx * dx + dy * dy) / size;
  }
  return count >= limits.min_white_cell_neighbours &&
         numeric::median_of_many(misfit.slice(0, count)) > limits.max_white_cell_misfit;
}

}  // namespace cmp::numbering
