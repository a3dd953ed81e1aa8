// Rows of pixels across gridlines, side by side: first pixel after first pixel, then the second ones.
//
// A row is a column of the image where the gridline runs along x rather than along y, else a row of the
// image. One gridline has few rows. Therefore the rows of many gridlines are handled at once; at last every
// gridline adds up its own rows.
#pragma once

#include <array>

#include "base/array.hpp"

namespace cmp::refine {

inline constexpr Index VECTOR_ROWS = 8;        // rows in one vector of the processor
inline constexpr Index MAX_FILTER_ROWS = 240;  // rows side by side
inline constexpr Index CHANNELS = 3;

template <class T>
using RowColumn = std::array<T, MAX_FILTER_ROWS + VECTOR_ROWS>;
template <class T>
using ChannelColumns = std::array<RowColumn<T>, CHANNELS>;

// The rows, one value of each in a column.
struct alignas(64) FilterRows {
  RowColumn<float> along, across;            // px, along and across the chord at the first pixel
  RowColumn<float> along_step, across_step;  // and from one pixel to the next
  RowColumn<float> last;                     // the number of the last pixel, -1 for none
  RowColumn<float> length, inverse_length;   // px and 1/px, of the gridline's chord
  RowColumn<float> leave, arrive;            // slopes against the chord at both ends
  ChannelColumns<float> contrast;            // the light before the gridline less that beyond
  ChannelColumns<float> foot;                // the light beyond
  RowColumn<std::int64_t> first, step, end;  // places in the flat image: first pixel, step, last pixel
};

// Sums over the pixels of each row, in units of the blur; those that move the markers are in float64, where
// the order of summing hardly changes them.
struct alignas(64) RowSums {
  RowColumn<double> aa, ab, bb, a, b;
  RowColumn<float> misfit, pixels;
  RowColumn<float> ac, ad, bc, bd, cc, cd, dd, c, d;
};

// One pixel of every row.
struct alignas(64) RowPixels {
  RowColumn<float> along;                 // the place along the gridline, 0 to 1
  RowColumn<float> density;               // the normal density at the pixel
  ChannelColumns<std::int32_t> place;     // of the drawn light in the table of values
  ChannelColumns<float> drawn, slope;     // the value of the drawn light, and its derivative by the light
  ChannelColumns<std::int32_t> observed;  // the value of the image
  RowColumn<float> pull;  // the residual times the derivative by the share of the light before the gridline
  RowColumn<float> information;  // that derivative squared
};

// Memory for rows side by side; rows beyond the last one are read, too.
struct FilterBuffers {
  FilterRows rows{};
  RowPixels pixels;
  RowSums sums;
};

// What the rows are compared with.
struct FilterImage {
  View<const std::uint8_t, 1> flat;  // the image
  View<const float, 1> encoded;      // as in ResponseTables
  float inverse_sigma;               // 1/px, of the blur
};

// Fills in the sums of the rows up to `count`, which is a whole number of vectors; those of the bending only
// if asked.
void fill_row_sums(const FilterImage& image, Index count, bool is_any_bending, FilterBuffers& buffers);

}  // namespace cmp::refine
