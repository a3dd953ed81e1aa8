// The table of edges that are measured together, and the profiles of light across them.
#pragma once

#include "base/array.hpp"
#include "cells/triangle_edges.hpp"
#include "numeric/bilinear_batch.hpp"

namespace cmp::cells {

inline constexpr Index BATCH_CELLS = numeric::BATCH_POINTS / 3;  // triangles measured together

// The begin of a column of the edges' table.
constexpr Index column(Index k) { return k * numeric::BATCH_POINTS; }

// the ends
inline constexpr Index START_X = column(0), START_Y = column(1), END_X = column(2), END_Y = column(3);
// the cell's centre, and the distance of its first corner from the centre
inline constexpr Index CENTRE_X = column(4), CENTRE_Y = column(5), SIZE = column(6);
// the normal, the edge's distance from the centre, and the vector from the centre to its middle
inline constexpr Index NORMAL_X = column(7), NORMAL_Y = column(8), DEPTH = column(9);
inline constexpr Index MEDIAN_X = column(10), MEDIAN_Y = column(11);
// the ink's color; the weights that turn a color into a share of ink; the background's weighted color
inline constexpr Index INK = column(12), WEIGHT = column(15), BACKGROUND = column(18);
// 1 if the edge is valid, else 0
inline constexpr Index VALID = column(19);
// the profiles' middles, and the areas under them
inline constexpr Index FIRST_X = column(20), FIRST_Y = column(21), SECOND_X = column(22),
                       SECOND_Y = column(23);
inline constexpr Index AREA = column(24), AREA_BEFORE = column(25);
// the line n . p = d
inline constexpr Index LINE_X = column(26), LINE_Y = column(27), LINE_D = column(28);
inline constexpr Index COLUMNS = 29;

// An image as the samples take it.
struct ProfileImage {
  View<const std::uint8_t, 1> flat;  // (3 H W,)
  View<const float, 1> light;        // (256,) the light of each value
  Index height, width;
};

// Writes the weights that separate each cell's ink from the color outside each edge, and the edges' validity.
//
// edges: the table; count: of edges, three for each cell: first edges, second edges, third edges.
void fill_contrast_weights(const ProfileImage& image, View<double, 1> edges, Index count,
                           numeric::SampleBuffers& buffers, const TriangleEdgeLimits& limits);

// Writes the profiles' middles; edges with a profile that leaves the image become invalid.
void fill_profile_places(const ProfileImage& image, View<double, 1> edges, Index count,
                         const TriangleEdgeLimits& limits);

// Writes the areas under the first or second profiles, in steps, and keeps the ones before in AREA_BEFORE.
void fill_profile_areas(const ProfileImage& image, bool second, View<double, 1> edges, Index count,
                        numeric::SampleBuffers& buffers, const TriangleEdgeLimits& limits);

}  // namespace cmp::cells
