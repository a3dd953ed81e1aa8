#include "numbering/white_search.hpp"

#include <cmath>

#include "numbering/white_placement.hpp"
#include "numeric/median.hpp"

namespace cmp::numbering {

namespace {

constexpr int ENCLOSING_CELLS = 3;  // that share a side with a down-cell

// The median color (3,) of the places predicted by the most cells.
Array<double, 1> black_color(View<const double, 2> color, View<const std::int64_t, 1> support_count) {
  const std::int64_t most = *std::max_element(support_count.begin(), support_count.end());
  Array<double, 1> black({3}), values({color.size()});
  for (int channel = 0; channel < 3; ++channel) {
    Index count = 0;
    for (Index i = 0; i < color.size(); ++i)
      if (support_count[i] == most) values[count++] = color(i, channel);
    black[channel] = numeric::median_of_many(values.slice(0, count));
  }
  return black;
}

// The bright places of at least this whiteness, the brightest first.
Array<Index, 1> select_brightest(const PlaceColors& shown, double least_whiteness,
                                 const WhiteSearchLimits& limits) {
  const View<const double, 1> brightness = shown.brightness, whiteness = shown.whiteness;
  Array<Index, 1> bright({brightness.size()});
  Index count = 0;
  for (Index i = 0; i < brightness.size(); ++i)
    if (brightness[i] > limits.min_white_ratio && whiteness[i] >= least_whiteness) bright[count++] = i;
  std::stable_sort(bright.begin(), bright.begin() + count,
                   [&](Index a, Index b) { return brightness[a] > brightness[b]; });
  return bright.first(std::min(count, limits.max_white_candidates));
}

Array<std::int32_t, 2> selected(View<const std::int32_t, 2> rows, View<const Index, 1> indices) {
  Array<std::int32_t, 2> out({indices.size(), rows.size(1)});
  for (Index n = 0; n < indices.size(); ++n)
    for (Index k = 0; k < rows.size(1); ++k) out(n, k) = rows(indices[n], k);
  return out;
}

// The axial places (E, 2) between three cells.
Array<std::int32_t, 2> enclosed_places(const localmap::PredictedPlaces& places) {
  Array<Index, 1> enclosed({places.axial.size()});
  Index count = 0;
  for (Index i = 0; i < places.axial.size(); ++i)
    if (places.support_count[i] == ENCLOSING_CELLS) enclosed[count++] = i;
  return selected(View<const std::int32_t, 2>(places.axial), enclosed.slice(0, count));
}

struct VerifiedPlaces {
  Array<std::int32_t, 2> cell;
  Array<std::int64_t, 1> inside, missing;
  Array<double, 2> middle;
  Array<bool, 1> fits;

  bool is_any_fit() const {
    const auto all = fits.view();
    return std::find(all.begin(), all.end(), true) != all.end();
  }
};

// The image and its cells.
struct Scene {
  View<const std::uint8_t, 3> image;
  View<const double, 2> center;
  View<const std::int32_t, 2> axial;
};

// Tries the white cell at axial places (P, 2).
VerifiedPlaces verify_placements(const Scene& scene, View<const std::int64_t, 1> known,
                                 View<const std::int32_t, 2> places, const WhiteCellLayout& layout,
                                 View<const double, 2> inks, View<const double, 1> black,
                                 const WhiteSearchLimits& limits) {
  const Index count = places.size();
  VerifiedPlaces out{Array<std::int32_t, 2>({count, scene.axial.size()}), Array<std::int64_t, 1>({count}, 0),
                     Array<std::int64_t, 1>({count}, 0), Array<double, 2>({count, 2}),
                     Array<bool, 1>({count})};
  const PlacedCells placed(scene.center, scene.axial, known, layout.cell_lookup);
  const auto height = static_cast<double>(scene.image.size(0)),
             width = static_cast<double>(scene.image.size(1));
  const double max_outside = limits.prediction.max_outside_share * static_cast<double>(known.size());
  for (Index n = 0; n < count; ++n) {
    const Index inside = placed.fill_placement(places[n], out.cell[n]);
    const PlanePoint middle =
        locate_white_cell(scene.image, scene.center, out.cell[n], layout, inks, black, limits.cell);
    out.middle(n, 0) = middle.x;
    out.middle(n, 1) = middle.y;
    if (!std::isnan(middle.x)) {
      out.inside[n] = inside;
      out.missing[n] = placed.count_missing(places[n], width, height);
    }
    out.fits[n] = out.inside[n] > 0 && static_cast<double>(known.size() - out.inside[n]) <= max_outside;
  }
  return out;
}

WhiteCandidates no_candidates() {
  return {0,
          -1,
          Array<std::int32_t, 2>({0, 0}),
          Array<std::int64_t, 1>({0}),
          Array<std::int64_t, 1>({0}),
          Array<double, 2>({0, 2}),
          Array<bool, 1>({0})};
}

}  // namespace

WhiteCandidates search_white_cell(View<const std::uint8_t, 3> image, const SearchedCells& cells,
                                  View<const std::int32_t, 2> axial, const WhiteCellLayout& layout,
                                  const WhiteSearchLimits& limits) {
  const auto center = cells.center_px;
  const auto [index, basis] = localmap::lattice_bases(center, axial, limits.prediction);
  // more cells than the layout has do not fit anywhere
  const Index more = index.size() - layout.center_mm.size();
  const double most = limits.prediction.max_outside_share * static_cast<double>(index.size());
  if (index.size() == 0 || static_cast<double>(more) > most) return no_candidates();
  const MeasuredInks inks = measure_inks(image, center, cells.area_px, cells.ink, index, limits.whiteness);
  const localmap::KnownCells known{index, basis, inks.radius_px, inks.level};
  auto grid = localmap::build_axial_grid(axial, known.cells, known.level);
  Array<double, 1> black;
  for (Index ring = 0; ring < localmap::RINGS; ++ring) {
    const bool is_far = ring > 0;
    if (ring == 1)
      localmap::update_excluded_misfits(grid, axial, known.cells, layout.layers, limits.prediction);
    const auto places = localmap::predicted_places(center, known, grid, ring, limits.prediction);
    const auto shown = measure_whiteness(image, places.means, inks.strongest, is_far);
    if (!is_far) {
      if (places.axial.size() == 0) break;
      black = black_color(shown.color, places.support_count);
      localmap::update_excluded_places(grid, enclosed_places(places));
    }
    const auto bright =
        select_brightest(shown, is_far ? limits.min_weakest_channel_far : limits.min_weakest_channel, limits);
    if (bright.size() == 0) continue;
    const auto candidates = selected(View<const std::int32_t, 2>(places.axial), bright);
    auto found = verify_placements({image, center, axial}, known.cells, candidates, layout, inks.colors,
                                   black, limits);
    if (found.is_any_fit())
      return {index.size(),
              ring,
              std::move(found.cell),
              std::move(found.inside),
              std::move(found.missing),
              std::move(found.middle),
              std::move(found.fits)};
    localmap::update_excluded_places(grid, candidates);
  }
  return no_candidates();
}

}  // namespace cmp::numbering
