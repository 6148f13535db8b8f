// SPDX-License-Identifier: Apache-2.0
// Convolution forward and input gradient as one implicit matrix product: rows are the channels of
// the target, columns its pixels, k runs over source channels and kernel taps. The columns' factor
// is read from padded planes of the source through a table of offsets, one per step of k.
//
// With stride s the pixels of the input gradient fall into s x s phases, each with its own taps;
// the forward pass has one phase of all taps.

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Padded copies of image channels, in which a convolution needs no bounds checks and no stride:
// source pixels are distributed over step x step planes by their position modulo the step, so that
// the pixels under one tap of the kernel are adjacent. Copies a block of channels and image rows at
// a time, never a whole im2col matrix.

// Plane (a, b) holds at (y, x) the source pixel in row y step + origin_row + a and column
// x step + origin_column + b, or 0 outside the image.
struct PlaneGrid {
  std::size_t height, width;  // of the source
  std::size_t step;
  std::ptrdiff_t origin_row, origin_column;
  std::size_t planes_down, planes_across;  // needed ones of step x step
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
  // Number of entries of a row before source pixel `limit`.
  std::ptrdiff_t Before(const PlaneGrid& g, std::ptrdiff_t limit) const {
    if (first >= limit) return 0;
    const auto step = static_cast<std::ptrdiff_t>(g.step);
    return std::min((limit - first + step - 1) / step, static_cast<std::ptrdiff_t>(g.columns));
  }
};

// out[x] = in[x] for x < count. Rows are short: a call of memmove would cost more than the copy.
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

// out[x] = in[2 x] for x < count; reads nothing past in[2 count - 2].
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

// Zeros entries before `begin` and from `end` on in a row of `count`, with vectors that may spill
// into the entries between, which are written afterwards.
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

// All planes of `channels` consecutive channels, starting at plane row `first_row` of the whole
// image. out: channels x channel_size().
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

// Divides a batch of grids of rows x columns into pieces of about `pixels`: bands of rows of one
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

constexpr std::size_t kConvDepth = 320;     // steps of k in one pass, about
constexpr std::size_t kConvPixels = 512;    // of the target grid per work item, about
constexpr std::size_t kPhasePixels = 1024;  // for several phases, if there are enough items
// For an image gradient: fewer sums than keep the FMA units busy, unless a tile has a third vector.
constexpr std::size_t kFewRows = 4;

// The taps of all phases, phase by phase: offsets into a source channel's planes and into its
// kernel.
struct ConvTaps {
  std::size_t* phase_begin;  // [phases + 1]
  std::size_t* plane;        // [taps]
  std::size_t* weight;       // [taps]
  std::size_t phases = 0;

  std::size_t count(std::size_t phase) const { return phase_begin[phase + 1] - phase_begin[phase]; }
  void BeginPhases() { phase_begin[phases = 0] = 0; }
  void EndPhase(std::size_t tap_count) { phase_begin[++phases] = tap_count; }
};

struct ConvProduct {
  const float* source;  // [batch, channels, planes.height, planes.width]
  std::size_t batch, channels;
  PlaneGrid planes;  // rows: of one band
  const float* weight;
  std::size_t weight_row_stride, weight_channel_stride;  // of target and source channels
  ConvTaps taps;
  std::size_t rows;                     // channels of the target
  std::size_t grid_rows, grid_columns;  // pixels of one phase
  const float* bias;                    // [rows] or null
  float* target;                        // [batch, rows, target_height, target_width]
  std::size_t target_height, target_width;
  std::size_t stride;  // of the target's phases, if there are several
  BatchCut cut;        // of the grids into work items

  std::size_t target_pixels() const { return target_height * target_width; }
  std::size_t tap_count() const { return taps.phase_begin[taps.phases]; }
};

// Extents derived from a product, and its scratch memory.
struct ConvWork {
  explicit ConvWork(const ConvProduct& p)
      : panels(p.rows, kTileRows),
        blocks(p.channels, std::max<std::size_t>(1, kConvDepth * p.taps.phases /
                                                        std::max<std::size_t>(1, p.tap_count()))),
        band_pixels(p.cut.bands.largest() * p.grid_columns),
        planes_size(RoundUp(blocks.largest() * p.planes.channel_size() + kTileColumns, kAlignment)),
        phases_size(p.taps.phases == 1 ? 0 : p.cut.images * p.taps.phases * p.rows * band_pixels) {}

  Panels panels;            // of target channels
  Panels blocks;            // of source channels
  std::size_t band_pixels;  // stride between rows of the phase buffer
  std::size_t planes_size, phases_size;
  float* packed_weight = nullptr;
  std::size_t* offsets = nullptr;  // phase by phase: [block channel][tap]

  std::size_t worker_size() const { return RoundUp(planes_size + phases_size, kAlignment); }
};

// The weights of one panel, block and phase: [k][rows], k = (channel, tap).
inline void PackConvWeights(const ConvProduct& p, const ConvWork& work, std::size_t panel,
                            std::size_t block, std::size_t phase, float* out) {
  const std::size_t row = work.panels.begin(panel), rows = work.panels.size(panel);
  const float* weight =
      p.weight + row * p.weight_row_stride + work.blocks.begin(block) * p.weight_channel_stride;
  for (std::size_t c = 0; c < work.blocks.size(block); ++c, weight += p.weight_channel_stride) {
    for (std::size_t t = p.taps.phase_begin[phase]; t < p.taps.phase_begin[phase + 1]; ++t) {
      const float* tap = weight + p.taps.weight[t];
      for (std::size_t r = 0; r < rows; ++r) *out++ = tap[r * p.weight_row_stride];
    }
  }
}

// Address of the panel's packed weights of one block and phase.
inline float* PackedConvWeights(const ConvProduct& p, const ConvWork& work, std::size_t panel,
                                std::size_t block, std::size_t phase) {
  const std::size_t channels = work.blocks.size(block);
  return work.packed_weight + p.rows * work.blocks.begin(block) * p.tap_count() +
         p.rows * channels * p.taps.phase_begin[phase] +
         work.panels.begin(panel) * channels * p.taps.count(phase);
}

inline void FillConvOffsets(const ConvProduct& p, const ConvWork& work) {
  std::size_t* out = work.offsets;
  for (std::size_t phase = 0; phase < p.taps.phases; ++phase) {
    for (std::size_t c = 0; c < work.blocks.largest(); ++c) {
      for (std::size_t t = p.taps.phase_begin[phase]; t < p.taps.phase_begin[phase + 1]; ++t) {
        *out++ = c * p.planes.channel_size() + p.taps.plane[t];
      }
    }
  }
}

// One phase of one image and band, one block of source channels.
struct ConvPass {
  const float* planes;
  std::size_t block, phase;
  std::size_t rows;            // of the grid
  float* c = nullptr;          // pixel 0 of row 0 of channel 0
  std::size_t ldc = 0;         // stride between channels of c
  std::size_t row_stride = 0;  // stride between grid rows of c
};

// Vectors of pixels, adjacent, or at the end of one row and the start of the next.
template <std::size_t V>
struct ConvColumns {
  ConvColumns(const ConvProduct& p, const ConvPass& pass, std::size_t first_vector)
      : target{.c = pass.c, .ldc = pass.ldc, .offset = {}, .count = {}} {
    const std::size_t per_row = DivideUp(p.grid_columns, kLanes);
    for (std::size_t v = 0; v < V; ++v) {
      const std::size_t vector = std::min(first_vector + v, per_row * pass.rows - 1);
      const std::size_t y = vector / per_row, x = vector % per_row * kLanes;
      source.base[v] = pass.planes + y * p.planes.columns + x;
      target.offset[v] = y * pass.row_stride + x;
      target.count[v] = vector == first_vector + v ? std::min(kLanes, p.grid_columns - x) : 0;
    }
  }
  IndirectColumns<V> source;
  TileTarget target;
};

// In tiles of at most R rows and V vectors.
template <std::size_t R, std::size_t V>
void RunConvPass(const ConvProduct& p, const ConvWork& work, const ConvPass& pass) {
  const std::size_t steps = work.blocks.size(pass.block) * p.taps.count(pass.phase);
  const std::size_t vectors = DivideUp(p.grid_columns, kLanes) * pass.rows;
  const std::size_t* offsets =
      work.offsets + work.blocks.largest() * p.taps.phase_begin[pass.phase];
  for (std::size_t vector = 0; vector < vectors; vector += V) {
    ConvColumns<V> columns(p, pass, vector);
    columns.source.offset = offsets;
    // Modified in place: a copy, read in wider words than it was written in, would wait for the
    // stores.
    TileTarget& target = columns.target;
    target.accumulate = pass.block > 0;
    for (std::size_t panel = 0; panel < work.panels.count(); ++panel) {
      const std::size_t row = work.panels.begin(panel);
      target.c = pass.c + row * pass.ldc;
      if (pass.block == 0 && p.bias != nullptr) target.row_bias = p.bias + row;
      PackedRowsTile<IndirectColumns<V>, R>(
          PackedConvWeights(p, work, panel, pass.block, pass.phase), work.panels.size(panel),
          columns.source, steps, target);
    }
  }
}

// All phases of one image's band for one block of source channels. phases: the buffer of this
// image, or null if the only phase is written straight to the target.
inline void RunConvPhases(const ConvProduct& p, const ConvWork& work, const BatchPiece& piece,
                          std::size_t image, ConvPass pass, float* phases) {
  for (pass.phase = 0; pass.phase < p.taps.phases; ++pass.phase) {
    if (phases == nullptr) {
      pass.c = p.target + image * p.rows * p.target_pixels() + piece.row * p.target_width;
      pass.ldc = p.target_pixels();
      pass.row_stride = p.target_width;
    } else {
      pass.c = phases + pass.phase * p.rows * work.band_pixels;
      pass.ldc = work.band_pixels;
      pass.row_stride = p.grid_columns;
    }
    if (p.rows <= kFewRows) {
      RunConvPass<kFewRows, kMostTileVectors>(p, work, pass);
    } else {
      RunConvPass<kTileRows, kTileVectors>(p, work, pass);
    }
  }
}

// out[2 x] = even[x], out[2 x + 1] = odd[x], `count` numbers in all.
inline void InterleavePair(const float* even, const float* odd, std::size_t count, float* out) {
  std::size_t x = 0;
  for (; 2 * (x + kLanes) <= count; x += kLanes) {
    hn::StoreInterleaved2(hn::LoadU(Tag(), even + x), hn::LoadU(Tag(), odd + x), Tag(),
                          out + 2 * x);
  }
  for (x *= 2; x < count; ++x) out[x] = x % 2 == 0 ? even[x / 2] : odd[x / 2];
}

// Pixels of one target row from the phases (a, b) of one grid row.
inline void InterleaveRow(const ConvProduct& p, const float* phase_row, std::size_t phase_stride,
                          float* out) {
  if (p.stride == 2) {
    return InterleavePair(phase_row, phase_row + phase_stride, p.target_width, out);
  }
  for (std::size_t x = 0; x < p.target_width; ++x) {
    out[x] = phase_row[x % p.stride * phase_stride + x / p.stride];
  }
}

// Target channel `row` of one image, the grid rows of `piece`.
inline void InterleaveChannel(const ConvProduct& p, const ConvWork& work, const BatchPiece& piece,
                              const float* phases, std::size_t row, float* target) {
  const std::size_t phase_size = p.rows * work.band_pixels;
  for (std::size_t y = 0; y < piece.rows; ++y) {
    for (std::size_t a = 0; a < p.stride; ++a) {
      const std::size_t h = (piece.row + y) * p.stride + a;
      if (h >= p.target_height) break;
      InterleaveRow(
          p, phases + a * p.stride * phase_size + row * work.band_pixels + y * p.grid_columns,
          phase_size, target + h * p.target_width);
    }
  }
}

inline void InterleaveImage(const ConvProduct& p, const ConvWork& work, const BatchPiece& piece,
                            std::size_t image, const float* phases) {
  for (std::size_t row = 0; row < p.rows; ++row) {
    InterleaveChannel(p, work, piece, phases, row,
                      p.target + (image * p.rows + row) * p.target_pixels());
  }
}

inline void RunConvPiece(const ConvProduct& p, const ConvWork& work, const BatchPiece& piece,
                         float* memory) {
  const std::size_t image_phases = p.taps.phases * p.rows * work.band_pixels;
  const auto phases = [&](std::size_t image) {
    return p.taps.phases == 1 ? nullptr
                              : memory + work.planes_size + (image - piece.image) * image_phases;
  };
  for (std::size_t block = 0; block < work.blocks.count(); ++block) {
    for (std::size_t image = piece.image; image < piece.image_end; ++image) {
      const float* source = p.source + (image * p.channels + work.blocks.begin(block)) *
                                           p.planes.height * p.planes.width;
      CopyPlanes(p.planes, source, work.blocks.size(block), piece.row, memory);
      ConvPass pass{.planes = memory, .block = block, .phase = 0, .rows = piece.rows};
      RunConvPhases(p, work, piece, image, pass, phases(image));
    }
  }
  if (p.taps.phases == 1) return;
  for (std::size_t image = piece.image; image < piece.image_end; ++image) {
    InterleaveImage(p, work, piece, image, phases(image));
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
