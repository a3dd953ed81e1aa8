// The pixels near a gridline, row by row across the gridline.
//
// A row is a column of the image where the gridline runs along x rather than along y, else a row of the
// image. The coordinate p counts rows, q the pixels of a row. All rows have the same number of pixels, and
// the number of rows is rounded up to whole lanes: the loops over pixels have no branches. The band of each
// row marks the pixels that count. Pixel j of row i stands at j * padded rows + i of a column of pixels.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "base/array.hpp"
#include "image/response.hpp"
#include "refine/synthesis/gridlines.hpp"

namespace cmp::refine {

inline constexpr Index CHUNK = 2128;  // pixels at once; a power of 2 would put all columns on one cache line
inline constexpr Index PIXEL_LANES = 16;  // rows in one vector of the processor

using PixelColumn = std::array<float, CHUNK>;
template <class T>
using ChannelPixels = std::array<std::array<T, CHUNK>, 3>;

// Limits of the pixels near a gridline.
struct PixelRowLimits {
  // in units of the blur, the distance from a gridline within which pixels count. The polynomials of
  // pixel_weights.hpp hold up to 0.4 more. Derived: erf(2.2), 99.8 % of what a gridline tells, lies within.
  double band = 2.2;
};

// The count rounded up to whole lanes.
inline Index padded_count(Index count) { return (count + PIXEL_LANES - 1) / PIXEL_LANES * PIXEL_LANES; }

// The part of an image that is looked at, px.
struct ImageArea {
  Index x_from, y_from, x_to, y_to;
};

// A gridline in the coordinates of the rows across the gridline.
struct RowFrame {
  double p, q;                   // px, the start of the gridline
  double up, uq;                 // the unit vector along the chord
  double length, leave, arrive;  // px, of the chord; slopes against the chord at both ends
  Index p_count, q_count;        // numbers of rows, and of pixels of a row, in the area
  Index step_p, step_q;          // values of the flat image between two rows, and between two pixels of a row
  double sense;                  // 1 where rows are columns of the image, -1 where rows are rows of the image
};

// The rows of one block, one value of each in a column.
struct alignas(64) BlockRows {
  std::array<std::int64_t, CHUNK> first;  // the places of the first pixels in the flat image
  PixelColumn along, across;              // px, along and across the chord at the first pixel
  PixelColumn from, to;                   // first and last pixel within the band
};

// Some rows of one gridline.
struct RowBlock {
  Index row_count;   // rows
  Index row_length;  // pixels of each row
  Index step;        // values of the flat image between two pixels of a row

  Index lanes() const { return padded_count(row_count); }
  Index pixels() const { return lanes() * row_length; }
};

// What a pixel's distance from a gridline is computed from.
struct PixelGeometry {
  float along_step, across_step;  // px, from one pixel of a row to the next, along and across the chord
  float inverse_sigma;            // 1/px, of the blur
  float inverse_length;           // 1/px, of the chord
  float length, leave, arrive;    // px; slopes against the chord at both ends
};

// The light along a gridline, three channels each.
struct SideLight {
  std::array<float, 3> contrast;  // of the drawn light, before the gridline less beyond
  std::array<float, 3> step;      // of the light that is added to the drawing, likewise
  std::array<float, 3> beyond;    // of the light that is added, beyond the gridline
};

// A value and its derivative by the light.
struct ValueAndSlope {
  float value, slope;
};

// The residuals of pixels: the image's values less the values of the drawn light.
struct alignas(64) Residuals {
  // the channels' residuals times their derivatives by the share of the light before the gridline, summed
  PixelColumn projection;
  PixelColumn information;                    // these derivatives squared, summed
  ChannelPixels<float> light;                 // the drawn light
  ChannelPixels<std::int32_t> place;          // of the light in the table of values
  ChannelPixels<ValueAndSlope> drawn;         // of the light
  std::array<std::uint32_t, CHUNK> observed;  // values of the image, one channel a byte

  // The residual of pixel k in a channel.
  float residual(std::size_t channel, Index k) const {
    const auto value = static_cast<std::int32_t>(observed[k] >> (8 * channel) & 255U);
    return static_cast<float>(value) - drawn[channel][k].value;
  }
};

// The numbers of pixels of a row, and of rows in one chunk.
struct RowSizes {
  Index wide, most;
};

// The image and the drawing that it is compared with, from the area's first pixel on.
struct ComparedImages {
  View<const std::uint8_t, 1> image;
  View<const float, 1> model;    // the drawn light; empty for none
  View<const float, 1> encoded;  // as in ResponseTables
};

// The frame of gridline e in an area of an image `width` px wide.
inline RowFrame row_frame(View<const double, 2> lines, Index e, const ImageArea& area, Index width) {
  const auto line = lines[e];
  const double x = line[X] - static_cast<double>(area.x_from), y = line[Y] - static_cast<double>(area.y_from);
  const double ux = line[UX], uy = line[UY], length = line[LENGTH], leave = line[LEAVE],
               arrive = line[ARRIVE];
  const Index columns = area.x_to - area.x_from, rows = area.y_to - area.y_from;
  if (std::abs(ux) > std::abs(uy))
    return {x, y, ux, uy, length, leave, arrive, columns, rows, 3, 3 * width, 1.0};
  return {y, x, uy, ux, length, leave, arrive, rows, columns, 3 * width, 3, -1.0};
}

// The geometry of a gridline's pixels; sigma px is the blur.
inline PixelGeometry pixel_geometry(const RowFrame& frame, double sigma) {
  return {static_cast<float>(frame.uq),     static_cast<float>(frame.sense * frame.up),
          static_cast<float>(1.0 / sigma),  static_cast<float>(1.0 / frame.length),
          static_cast<float>(frame.length), static_cast<float>(frame.leave),
          static_cast<float>(frame.arrive)};
}

// half px: the band reaches as far to both sides; most: pixels of a row in the image.
inline RowSizes row_sizes(double half, Index most) {
  const Index wide =
      std::max<Index>(std::min({static_cast<Index>(2.0 * half) + 1, most, CHUNK / PIXEL_LANES}), 1);
  return {wide, CHUNK / (wide * PIXEL_LANES) * PIXEL_LANES};
}

// The light of gridline e; sides and added (E, 6) are the drawn light and that to add on both sides.
inline SideLight side_light(View<const double, 2> sides, View<const double, 2> added, Index e) {
  SideLight light;
  const auto side = sides[e], more = added[e];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto channel = static_cast<Index>(k);
    // where levels have gone astray, a contrast that no image has would stand for information
    const auto contrast = static_cast<float>(side[channel] - side[channel + 3]);
    light.contrast[k] = std::clamp(contrast, -image::BRIGHTEST, image::BRIGHTEST);
    light.step[k] = static_cast<float>(more[channel] - more[channel + 3]);
    light.beyond[k] = static_cast<float>(more[channel + 3]);
  }
  return light;
}

// Fills in the columns of the rows of a block, from the row p = first on.
//
// half px: the band of a row reaches as far to both sides of the gridline.
void fill_rows(const RowBlock& block, Index first, const RowFrame& frame, double half, BlockRows& rows);

// Looks up the values of the image and of the drawn light in the pixels of a block.
//
// shares (n,): the share of the light before the gridline in each pixel.
void fill_values(const ComparedImages& images, const RowBlock& block, const BlockRows& rows,
                 const SideLight& light, const PixelColumn& shares, Residuals& out);

}  // namespace cmp::refine
