#include "refine/synthesis/pixel_rows.hpp"

#include "base/processor.hpp"
#include "image/response.hpp"

namespace cmp::refine {

namespace {

// Copies the drawn light and the values of the image in the pixels of a block; `model` may be empty.
void fill_channels(const ComparedImages& images, const RowBlock& block, const BlockRows& rows,
                   Residuals& out) {
  const std::uint8_t* const image = images.image.data();
  const float* const model = images.model.data();
  const bool is_drawn = images.model.size() > 0;
  for (Index j = 0; j < block.row_length; ++j) {
    const Index own = j * block.lanes(), step = j * block.step;
    for (Index i = 0; i < block.row_count; ++i) {
      const Index at = rows.first[i] + step;
      const std::uint32_t red = image[at], green = image[at + 1], blue = image[at + 2];
      out.observed[own + i] = red | green << 8 | blue << 16;
      for (std::size_t channel = 0; channel < 3; ++channel)
        out.light[channel][own + i] = is_drawn ? model[at + static_cast<Index>(channel)] : 0.0F;
    }
  }
}

// Fills in the places of the drawn light in the table of values.
void fill_places(const SideLight& light, const PixelColumn& shares, Index count, Residuals& out) {
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const float step = light.step[channel], beyond = light.beyond[channel];
    const auto& drawn = out.light[channel];
    auto& place = out.place[channel];
#pragma omp simd
    for (Index k = 0; k < count; ++k) place[k] = image::table_place(drawn[k] + beyond + shares[k] * step);
  }
}

// Looks up the values of the drawn light; a value and its slope are moved as one word.
void fill_drawn(View<const float, 1> encoded, const RowBlock& block, Residuals& out) {
  const float* const table = encoded.data();
  for (Index j = 0; j < block.row_length; ++j) {
    const Index begin = j * block.lanes(), end = begin + block.row_count;
    for (Index k = begin; k < end; ++k) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const float* const entry = table + out.place[channel][k];
        out.drawn[channel][k] = {entry[0], entry[1]};
      }
    }
  }
}

// Fills in the columns of the rows; see fill_rows.
void fill_row_columns(const RowBlock& block, Index first, const RowFrame& frame, double half,
                      BlockRows& rows) {
  const double p0 = frame.p, q0 = frame.q, up = frame.up, uq = frame.uq, sense = frame.sense;
  const double leave = frame.leave, arrive = frame.arrive;
  const double lean = uq / up, per_length = 1.0 / (up * frame.length), bulge = sense * frame.length / up;
  const auto top = static_cast<double>(frame.q_count - block.row_length);
  const auto lanes = static_cast<std::int32_t>(block.lanes());
  const Index step_p = frame.step_p, step_q = frame.step_q;
  for (std::int32_t i = 0; i < lanes; ++i) {
    const double f = static_cast<double>(first) + i - p0;
    const double t = f * per_length;
    const double inside = std::min(std::max(t, 0.0), 1.0);
    const double off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside);
    const double middle =
        q0 + lean * f + bulge * (off + leave * std::min(t, 0.0) + arrive * std::max(t - 1.0, 0.0));
    const double start = std::ceil(middle - half), stop = std::floor(middle + half);
    const double base = std::min(std::max(start, 0.0), top);
    rows.first[i] = (first + i) * step_p + static_cast<std::int32_t>(base) * step_q;
    const double g = base - q0;
    rows.along[i] = static_cast<float>(f * up + g * uq);
    rows.across[i] = static_cast<float>(sense * (g * up - f * uq));
    rows.from[i] = static_cast<float>(start - base);
    rows.to[i] = static_cast<float>(stop - base);
  }
  // outside the loop, which the compiler would otherwise split there
  std::fill(rows.to.begin() + block.row_count, rows.to.begin() + lanes, -1.0F);
}

}  // namespace

void fill_rows(const RowBlock& block, Index first, const RowFrame& frame, double half, BlockRows& rows) {
  run_loop<fill_row_columns>(block, first, frame, half, rows);
}

void fill_values(const ComparedImages& images, const RowBlock& block, const BlockRows& rows,
                 const SideLight& light, const PixelColumn& shares, Residuals& out) {
  fill_channels(images, block, rows, out);
  run_loop<fill_places>(light, shares, block.pixels(), out);
  fill_drawn(images.encoded, block, out);
}

}  // namespace cmp::refine
