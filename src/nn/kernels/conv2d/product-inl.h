// SPDX-License-Identifier: Apache-2.0
// Convolution forward and input gradient as one implicit matrix product: rows are the channels of
// the target, columns its pixels, k runs over source channels and kernel taps. The columns' factor
// is read from padded planes of the source through a table of offsets, one a step of k.
//
// With stride s the pixels of the input gradient fall into s x s phases, each with its own taps;
// the forward pass has one phase of all taps.

#if defined(TILEGRAD_NN_KERNELS_CONV2D_PRODUCT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_CONV2D_PRODUCT_INL_H_
#undef TILEGRAD_NN_KERNELS_CONV2D_PRODUCT_INL_H_
#else
#define TILEGRAD_NN_KERNELS_CONV2D_PRODUCT_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/planes-inl.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kConvDepth = 320;     // steps of k in one pass, about
constexpr std::size_t kConvPixels = 512;    // of the target grid in one work item, about
constexpr std::size_t kPhasePixels = 1024;  // the same of several phases, if there are items enough
// Of an image gradient: fewer sums than FMA units keep busy, unless a tile has a third vector.
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

// Extents derived from a product, and the memory that it works in.
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
  std::size_t band_pixels;  // from one row of the phase buffer to the next
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

// Where the panel's packed weights of one block and phase begin.
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
  std::size_t ldc = 0;         // from one channel of c to the next
  std::size_t row_stride = 0;  // from one grid row of c to the next
};

// Vectors of pixels, side by side or at the end of one row and the beginning of the next.
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
    // Changed in place: a copy, read in wider words than it was written in, waits for the writing.
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
// image, or null where the only phase goes straight to the target.
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

#endif  // per-target include guard
