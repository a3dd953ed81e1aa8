#include "refine/measure/matched_filter.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/parts.hpp"
#include "refine/measure/filter_rows.hpp"
#include "refine/synthesis/gridline_sides.hpp"
#include "refine/synthesis/gridlines.hpp"
#include "refine/synthesis/pixel_rows.hpp"
#include "refine/synthesis/residual_kernel.hpp"

namespace cmp::refine {

namespace {

// Gridlines whose rows stand side by side.
struct HeldGridlines {
  FilterBuffers buffers;
  std::array<Index, MAX_FILTER_ROWS> owner{};      // the gridlines
  std::array<Index, MAX_FILTER_ROWS + 1> begin{};  // their first rows
  Index count = 0;
};

// The rows p = first, first + every ... of a gridline; they reach half px to both sides.
struct RowChoice {
  Index first, every, count;
  double half;
};

Index padded(Index count) { return (count + VECTOR_ROWS - 1) / VECTOR_ROWS * VECTOR_ROWS; }

// Fills in a vector of rows from row `begin` on: those from row `from` of a gridline on.
//
// A row has the pixels up to choice.half px off the gridline, none where these leave the image.
void fill_vector(Index begin, Index from, const RowChoice& choice, const RowFrame& frame, FilterRows& rows) {
  const double p0 = frame.p, q0 = frame.q, up = frame.up, uq = frame.uq, half = choice.half;
  const double leave = frame.leave, arrive = frame.arrive, sense = frame.sense;
  const double lean = uq / up, per_length = 1.0 / (up * frame.length), bulge = sense * frame.length / up;
  const auto q_count = static_cast<double>(frame.q_count), every = static_cast<double>(choice.every);
  const auto first = static_cast<double>(choice.first + from * choice.every);
  const auto left = static_cast<double>(choice.count - from);  // rows of the gridline in this vector
  std::array<double, VECTOR_ROWS> starts, lasts;
  for (int k = 0; k < VECTOR_ROWS; ++k) {
    const double f = first + k * every - p0;
    const double t = f * per_length;
    const double inside = std::min(std::max(t, 0.0), 1.0);
    const double off = inside * (1.0 - inside) * (leave * (1.0 - inside) - arrive * inside);
    const double middle =
        q0 + lean * f + bulge * (off + leave * std::min(t, 0.0) + arrive * std::max(t - 1.0, 0.0));
    const double start = std::ceil(middle - half), stop = std::floor(middle + half);
    const bool is_empty = (k >= left) | (start < 0.0) | (stop >= q_count) | (stop < start);
    const double g = start - q0;
    rows.along[begin + k] = static_cast<float>(f * up + g * uq);
    rows.across[begin + k] = static_cast<float>(sense * (g * up - f * uq));
    starts[k] = is_empty ? -1.0 : start;
    lasts[k] = is_empty ? -1.0 : stop - start;
  }
  for (int k = 0; k < VECTOR_ROWS; ++k) {
    const Index i = begin + k, p = choice.first + (from + k) * choice.every;
    const auto start = static_cast<Index>(starts[k]), last = static_cast<Index>(lasts[k]);
    rows.last[i] = static_cast<float>(lasts[k]);
    rows.first[i] = start < 0 ? 0 : p * frame.step_p + start * frame.step_q;
    rows.end[i] = rows.first[i] + std::max<Index>(last, 0) * frame.step_q;
  }
}

// Fills in what is the same in all rows of a gridline, a vector from row `begin` on; side (6,), the light on
// both sides.
void fill_constants(Index begin, const RowFrame& frame, View<const double, 1> side, FilterRows& rows) {
  const auto fill = [=](RowColumn<float>& column, double value) {
    std::fill_n(column.begin() + begin, VECTOR_ROWS, static_cast<float>(value));
  };
  fill(rows.along_step, frame.uq);
  fill(rows.across_step, frame.sense * frame.up);
  fill(rows.length, frame.length);
  fill(rows.inverse_length, 1.0 / frame.length);
  fill(rows.leave, frame.leave);
  fill(rows.arrive, frame.arrive);
  for (int channel = 0; channel < CHANNELS; ++channel) {
    fill(rows.contrast[channel], side[BEFORE + channel] - side[BEYOND + channel]);
    fill(rows.foot[channel], side[BEYOND + channel]);
  }
  std::fill_n(rows.step.begin() + begin, VECTOR_ROWS, frame.step_q);
}

// Writes the sums over the rows from begin to end of one gridline, out (24,); false, and nothing written,
// where its offset exceeds `most` px.
bool fill_gridline_sums(const RowSums& sums, Index begin, Index end, double sigma, double most,
                        View<double, 1> out) {
  double aa = 0.0, ab = 0.0, bb = 0.0, a = 0.0, b = 0.0, squares = 0.0, pixels = 0.0;
  for (Index i = begin; i < end; ++i) {
    aa += sums.aa[i];
    ab += sums.ab[i];
    bb += sums.bb[i];
    a += sums.a[i];
    b += sums.b[i];
    squares += sums.misfit[i];
    pixels += sums.pixels[i];
  }
  if (!(std::abs(a + b) * sigma < most * (aa + 2.0 * ab + bb))) return false;
  const double unit = 1.0 / sigma, per_unit = 1.0 / (sigma * sigma);
  out[AA] = per_unit * aa;
  out[AB] = per_unit * ab;
  out[BB] = per_unit * bb;
  out[A] = unit * a;
  out[B] = unit * b;
  out[MISFIT] = squares;
  out[PIXELS] = pixels;
  return true;
}

// The same for the bending of a gridline.
void fill_bending_sums(const RowSums& sums, Index begin, Index end, double sigma, View<double, 1> out) {
  double ac = 0.0, ad = 0.0, bc = 0.0, bd = 0.0, cc = 0.0, cd = 0.0, dd = 0.0, c = 0.0, d = 0.0;
  for (Index i = begin; i < end; ++i) {
    ac += sums.ac[i];
    ad += sums.ad[i];
    bc += sums.bc[i];
    bd += sums.bd[i];
    cc += sums.cc[i];
    cd += sums.cd[i];
    dd += sums.dd[i];
    c += sums.c[i];
    d += sums.d[i];
  }
  const double unit = 1.0 / sigma, per_unit = 1.0 / (sigma * sigma);
  out[AC] = per_unit * ac;
  out[AD] = per_unit * ad;
  out[BC] = per_unit * bc;
  out[BD] = per_unit * bd;
  out[CC] = per_unit * cc;
  out[CD] = per_unit * cd;
  out[DD] = per_unit * dd;
  out[C] = unit * c;
  out[D] = unit * d;
}

// Reads the rows of gridlines (E, 8), many gridlines at once.
class ProfileReader {
 public:
  ProfileReader(const image::PyramidLevel& view, View<const double, 2> lines, double sigma,
                View<const bool, 1> is_bending, const MatchedFilterLimits& limits, View<double, 2> out)
      : image_{view.image.flat(), view.response.encoded, static_cast<float>(1.0 / sigma)},
        lines_(lines),
        is_bending_(is_bending),
        sigma_(sigma),
        limits_(limits),
        held_(std::make_unique<HeldGridlines>()),
        out_(out) {}

  void add(Index e, const RowChoice& choice, const RowFrame& frame, View<const double, 1> side) {
    if (held_->begin[held_->count] + choice.count > MAX_FILTER_ROWS) read();
    HeldGridlines& own = *held_;
    const Index begin = own.begin[own.count];
    for (Index from = 0; from < choice.count; from += VECTOR_ROWS) {
      fill_vector(begin + from, from, choice, frame, own.buffers.rows);
      fill_constants(begin + from, frame, side, own.buffers.rows);
    }
    own.owner[own.count] = e;
    own.begin[own.count + 1] = begin + choice.count;
    ++own.count;
  }

  // Fills in the sums of the gridlines in the buffers, which are empty afterwards.
  void read() {
    HeldGridlines& own = *held_;
    const auto is_bending = [&](Index e) { return is_bending_[e]; };
    const bool is_any_bending = std::any_of(own.owner.begin(), own.owner.begin() + own.count, is_bending);
    fill_row_sums(image_, padded(own.begin[own.count]), is_any_bending, own.buffers);
    for (Index i = 0; i < own.count; ++i) {
      const Index e = own.owner[i], begin = own.begin[i], end = own.begin[i + 1];
      const double most = std::max(limits_.min_offset_px, limits_.max_offset_share * lines_(e, LENGTH));
      const bool is_read = fill_gridline_sums(own.buffers.sums, begin, end, sigma_, most, out_[e]);
      if (is_read && is_bending_[e]) fill_bending_sums(own.buffers.sums, begin, end, sigma_, out_[e]);
    }
    own.count = 0;
  }

 private:
  FilterImage image_;
  View<const double, 2> lines_;
  View<const bool, 1> is_bending_;
  double sigma_;
  MatchedFilterLimits limits_;
  std::unique_ptr<HeldGridlines> held_;
  View<double, 2> out_;
};

// The rows across a gridline between its corners, `most` at most; clearance (4,).
RowChoice choose_rows(const RowFrame& frame, View<const double, 1> clearance, double sigma, Index most,
                      const MatchedFilterLimits& limits) {
  // the sharper a corner, the longer the gridline runs close to its neighbour
  const auto clear_share = [&](double sine) {
    const double share = limits.clear_sigma * sigma / (frame.length * sine);
    return std::min(std::max(share, limits.min_end_share), limits.max_end_share);
  };
  const double start = clear_share(clearance[SINE_A]), end = 1.0 - clear_share(clearance[SINE_B]);
  const double from_p = frame.p + start * frame.length * frame.up;
  const double to_p = frame.p + end * frame.length * frame.up;
  auto first = static_cast<Index>(std::ceil(std::min(from_p, to_p)));
  const auto last = static_cast<Index>(std::floor(std::max(from_p, to_p)));
  if (last < first) return {first, 1, 0, 0.0};
  const Index every = (last - first) / most + 1;
  first += (last - first) % every / 2;
  first += std::max<Index>(every - 1 - first, 0) / every * every;  // within the image
  const Index reached = std::min(last, frame.p_count - 1) - first;
  if (reached < 0) return {first, every, 0, 0.0};
  const double half =
      std::min(limits.reach_sigma * sigma, limits.max_reach * clearance[HEIGHT]) / std::abs(frame.up);
  return {first, every, std::min(reached / every + 1, MAX_FILTER_ROWS), half};
}

}  // namespace

Array<double, 2> read_profiles(const image::PyramidLevel& view, View<const double, 2> lines,
                               const EdgeContrasts& across, double sigma, View<const bool, 1> is_bending,
                               Index most, const MatchedFilterLimits& limits) {
  const Index height = view.image.size(0), width = view.image.size(1);
  const ImageArea area{0, 0, width, height};
  Array<double, 2> out({lines.size(), SUMS}, 0.0);
  in_parts(lines.size(), lines.size(), [&](Index begin, Index end) {
    ProfileReader reader(view, lines, sigma, is_bending, limits, out);
    for (Index e = begin; e < end; ++e) {
      if (lines(e, KNOWN) == 0.0 || across.clearance(e, SQUARED_CONTRAST) == 0.0) continue;
      const RowFrame frame = row_frame(lines, e, area, width);
      const RowChoice choice = choose_rows(frame, across.clearance[e], sigma, most, limits);
      if (choice.count > 0) reader.add(e, choice, frame, across.sides[e]);
    }
    reader.read();
  });
  return out;
}

}  // namespace cmp::refine
