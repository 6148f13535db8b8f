// SPDX-License-Identifier: Apache-2.0
// Padded copies of image channels in which a convolution needs no bounds and no stride: source
// pixels are dealt out to step x step planes by their position modulo the step, so that the pixels
// under one tap of the kernel lie side by side. A block of channels and image rows at a time is
// copied, never a whole im2col matrix.

#if defined(TILEGRAD_NN_KERNELS_CONV2D_PLANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_CONV2D_PLANES_INL_H_
#undef TILEGRAD_NN_KERNELS_CONV2D_PLANES_INL_H_
#else
#define TILEGRAD_NN_KERNELS_CONV2D_PLANES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Plane (a, b) holds at (y, x) the source pixel in row y step + origin_row + a and column
// x step + origin_column + b, or 0 outside the image.
struct PlaneGrid {
  std::size_t height, width;  // of the source
  std::size_t step;
  std::ptrdiff_t origin_row, origin_column;
  std::size_t planes_down, planes_across;  // that are needed of step x step
  std::size_t rows, columns;               // of one plane

  std::size_t plane_size() const { return rows * columns; }
  std::size_t channel_size() const { return planes_down * planes_across * plane_size(); }
};

// A row of plane column b: entries [begin, end) are the source pixels x step + first, the others 0.
struct PlaneRowSpan {
  PlaneRowSpan(const PlaneGrid& g, std::size_t b)
      : first(g.origin_column + static_cast<std::ptrdiff_t>(b)),
        begin(Before(g, 0)),
        end(std::max(begin, Before(g, static_cast<std::ptrdiff_t>(g.width)))) {}
  std::ptrdiff_t first, begin, end;

 private:
  // How many entries of a row lie before source pixel `limit`.
  std::ptrdiff_t Before(const PlaneGrid& g, std::ptrdiff_t limit) const {
    if (first >= limit) return 0;
    const auto step = static_cast<std::ptrdiff_t>(g.step);
    return std::min((limit - first + step - 1) / step, static_cast<std::ptrdiff_t>(g.columns));
  }
};

// out[x] = in[x] for x < count. Rows are short: a call of memmove for each costs more than they do.
inline void CopyFloats(const float* in, std::size_t count, float* out) {
  const Tag d;
  if (count < kLanes) {
    for (std::size_t x = 0; x < count; ++x) out[x] = in[x];
    return;
  }
  for (std::size_t x = 0; x < count - kLanes; x += kLanes) {
    hn::StoreU(hn::LoadU(d, in + x), d, out + x);
  }
  const std::size_t last = count - kLanes;  // may overlap the one before
  hn::StoreU(hn::LoadU(d, in + last), d, out + last);
}

// out[x] = in[2 x] for x < count; reads nothing behind in[2 count - 2].
inline void CopyEverySecond(const float* in, std::size_t count, float* out) {
  const Tag d;
  if (count <= kLanes) {
    for (std::size_t x = 0; x < count; ++x) out[x] = in[2 * x];
    return;
  }
  Vec even, odd;
  for (std::size_t x = 0; x < count - kLanes; x += kLanes) {
    hn::LoadInterleaved2(d, in + 2 * x, even, odd);
    hn::StoreU(even, d, out + x);
  }
  const std::size_t last = count - kLanes;
  hn::LoadInterleaved2(d, in + 2 * last - 1, odd, even);
  hn::StoreU(even, d, out + last);
}

// Zeros before entry `begin` and from entry `end` on of a row of `count`, by vectors that may reach
// into the entries between them: these are written afterwards.
inline void ClearRowEnds(std::size_t begin, std::size_t end, std::size_t count, float* out) {
  if (count >= kLanes && begin <= kLanes && count - end <= kLanes) {
    hn::StoreU(hn::Zero(Tag()), Tag(), out);
    hn::StoreU(hn::Zero(Tag()), Tag(), out + count - kLanes);
  } else {
    std::fill(out, out + begin, 0.0f);
    std::fill(out + end, out + count, 0.0f);
  }
}

// One row of one plane from a source row.
inline void CopyPlaneRow(const PlaneGrid& g, const PlaneRowSpan& span, const float* row,
                         float* out) {
  const auto step = static_cast<std::ptrdiff_t>(g.step);
  ClearRowEnds(static_cast<std::size_t>(span.begin), static_cast<std::size_t>(span.end), g.columns,
               out);
  if (step == 1) {
    CopyFloats(row + (span.first + span.begin), static_cast<std::size_t>(span.end - span.begin),
               out + span.begin);
  } else if (step == 2 && span.end > span.begin) {
    CopyEverySecond(row + (2 * span.begin + span.first),
                    static_cast<std::size_t>(span.end - span.begin), out + span.begin);
  } else {
    for (std::ptrdiff_t x = span.begin; x < span.end; ++x) out[x] = row[x * step + span.first];
  }
}

// Prefetches the same row some channels on: the rows of a band are too short for the hardware
// prefetcher.
inline void FetchRow(const PlaneGrid& g, const float* row) {
  constexpr std::size_t kChannels = 4;  // a few hundred cycles
  PrefetchNumbers(row + kChannels * g.height * g.width, g.width);
}

// One plane of one channel, its row 0 being source row `first_row`.
inline void CopyPlane(const PlaneGrid& g, const PlaneRowSpan& span, const float* channel,
                      std::ptrdiff_t first_row, float* out) {
  for (std::size_t y = 0; y < g.rows; ++y, out += g.columns) {
    const std::ptrdiff_t row = first_row + static_cast<std::ptrdiff_t>(y * g.step);
    if (row < 0 || row >= static_cast<std::ptrdiff_t>(g.height)) {
      std::fill_n(out, g.columns, 0.0f);
    } else {
      const float* source = channel + static_cast<std::size_t>(row) * g.width;
      FetchRow(g, source);
      CopyPlaneRow(g, span, source, out);
    }
  }
}

// All planes of `channels` consecutive channels, the first plane row being `first_row` of the
// planes of a whole image. out: channels x channel_size().
inline void CopyPlanes(const PlaneGrid& g, const float* source, std::size_t channels,
                       std::size_t first_row, float* out) {
  const std::ptrdiff_t top = static_cast<std::ptrdiff_t>(first_row * g.step) + g.origin_row;
  for (std::size_t b = 0; b < g.planes_across; ++b) {
    const PlaneRowSpan span(g, b);
    for (std::size_t c = 0; c < channels; ++c) {
      for (std::size_t a = 0; a < g.planes_down; ++a) {
        CopyPlane(g, span, source + c * g.height * g.width, top + static_cast<std::ptrdiff_t>(a),
                  out + c * g.channel_size() + (a * g.planes_across + b) * g.plane_size());
      }
    }
  }
}

// How a batch of grids of rows x columns is cut into pieces of about `pixels`: bands of rows of one
// image, or groups of whole images.
struct BatchCut {
  BatchCut(std::size_t batch_size, std::size_t grid_rows, std::size_t columns, std::size_t pixels)
      : batch(batch_size),
        rows(grid_rows),
        images(
            std::clamp<std::size_t>(pixels / (rows * columns), 1, std::max<std::size_t>(batch, 1))),
        bands(rows, std::max<std::size_t>(1, pixels / columns)) {}

  std::size_t groups() const { return DivideUp(batch, images); }
  std::size_t pieces() const { return groups() * bands.count(); }

  std::size_t batch, rows;
  std::size_t images;  // in one piece, 1 if there are several bands
  Panels bands;        // of rows
};

// One piece: images [image, image_end), grid rows [row, row + rows).
struct BatchPiece {
  BatchPiece(const BatchCut& cut, std::size_t index)
      : image(index / cut.bands.count() * cut.images),
        image_end(std::min(cut.batch, image + cut.images)),
        row(cut.bands.begin(index % cut.bands.count())),
        rows(cut.bands.size(index % cut.bands.count())) {}
  std::size_t image, image_end, row, rows;
};

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
