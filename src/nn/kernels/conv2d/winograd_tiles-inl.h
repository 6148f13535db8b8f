// SPDX-License-Identifier: Apache-2.0
// Converts between images and transformed values. Images are first split into one array per place
// in a tile, with adjacent tiles adjacent, so that the transforms are arithmetic on whole vectors
// whatever the image size.

#if defined(TILEGRAD_NN_CONV2D_WINOGRAD_TILES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_CONV2D_WINOGRAD_TILES_INL_H_
#undef TILEGRAD_NN_CONV2D_WINOGRAD_TILES_INL_H_
#else
#define TILEGRAD_NN_CONV2D_WINOGRAD_TILES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include "nn/kernels/conv2d/winograd_plan.h"
#include "nn/kernels/conv2d/winograd_transform-inl.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kMaxSlots = 16;

// The layout of one side's values per slot: value `index` of panel `panel` of tiles.
struct SlotLayout {
  std::array<std::size_t, kMaxSlots> base{}, panel_stride{};
  std::size_t index_stride = 0;
  std::size_t At(std::size_t slot, std::size_t index, std::size_t panel) const {
    return base[slot] + panel * panel_stride[slot] + index * index_stride;
  }
};

// [slot][panel][index][kTileColumns]: the column factor of a product.
inline SlotLayout PanelLayout(const WinogradSide& side, const TileRows& rows) {
  SlotLayout layout;
  layout.index_stride = kTileColumns;
  for (std::size_t slot = 0; slot < side.plan.slots(); ++slot) {
    layout.base[slot] = side.before(slot) * rows.padded + slot * kTileColumns;
    layout.panel_stride[slot] = side.size(slot) * kTileColumns;
  }
  return layout;
}

// [slot][index][tile]
inline SlotLayout RowLayout(const WinogradSide& side, const TileRows& rows) {
  SlotLayout layout;
  layout.index_stride = rows.pitch;
  for (std::size_t slot = 0; slot < side.plan.slots(); ++slot) {
    layout.base[slot] = side.before(slot) * rows.pitch;
    layout.panel_stride[slot] = kTileColumns;
  }
  return layout;
}

// Enough for either layout.
inline std::size_t SlotLayoutSize(const WinogradSide& side, const TileRows& rows) {
  return side.total() * rows.pitch + side.plan.slots() * kTileColumns;
}

// ---- Inputs: tiles of span x span at distance `step` ----

// Memory of one worker: [span * span][pitch] for the places of a tile, and the image rows that a
// tile reads, padded.
inline std::size_t PlacesSize(const WinogradPlan& plan, const TileRows& rows) {
  return plan.span * plan.span * rows.pitch;
}
inline std::size_t PaddedPitch(const WinogradPlan& plan) {
  return RoundUp(plan.step * (plan.tiles_across + kLanes) + plan.span, kTileColumns);
}
inline std::size_t PaddedRowsSize(const WinogradPlan& plan) {
  return plan.span * PaddedPitch(plan);
}

// The image rows read by a row of tiles that are inside the image: row i is `first` + i.
struct SeenRows {
  SeenRows(const WinogradPlan& plan, const TileRow& row)
      : first(static_cast<std::ptrdiff_t>(row.down * plan.step) -
              static_cast<std::ptrdiff_t>(plan.s.padding)),
        begin(static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, -first))),
        end(static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
            static_cast<std::ptrdiff_t>(plan.s.in_height) - first,
            static_cast<std::ptrdiff_t>(begin), static_cast<std::ptrdiff_t>(plan.span)))) {}
  bool Has(std::size_t i) const { return i >= begin && i < end; }
  // Row i, begin <= i < end.
  std::size_t operator[](std::size_t i) const {
    return static_cast<std::size_t>(first + static_cast<std::ptrdiff_t>(i));
  }
  std::ptrdiff_t first;
  std::size_t begin, end;
};

inline void DealRow(const WinogradPlan& plan, const float* padded, std::size_t pitch,
                    float* places) {
  const std::size_t tiles = plan.tiles_across;
  if (plan.span == 4) return DealRow<4, 2>(padded, tiles, pitch, places);
  if (plan.span == 6) return DealRow<6, 4>(padded, tiles, pitch, places);
  DealRow<7, 4>(padded, tiles, pitch, places);
}

// Prefetches the first image rows that row `index` of tiles reads from channel c.
inline void PrefetchRows(const WinogradPlan& plan, std::size_t index, const float* x,
                         std::size_t c) {
  const Conv2dShape& s = plan.s;
  const TileRow row(plan, std::min(index, plan.tile_rows() - 1));
  const std::size_t top = std::min(row.down * plan.step, s.in_height);
  const float* first = x + (row.image * s.in_channels + c) * s.in_pixels() + top * s.in_width;
  PrefetchNumbers(first, std::min(plan.step, s.in_height - top) * s.in_width);
}

// All places of channel c of the input. What a row writes past its tiles, the next one overwrites.
inline void GatherInput(const WinogradPlan& plan, const TileRows& rows, const float* x,
                        std::size_t c, float* places, float* padded) {
  const Conv2dShape& s = plan.s;
  const std::size_t pitch = PaddedPitch(plan);
  std::fill_n(padded, PaddedRowsSize(plan), 0.0f);
  // The part of a row that tiles read: at most the row, at most the padded row.
  const std::size_t seen =
      std::min(s.in_width, plan.step * (plan.tiles_across - 1) + plan.span - s.padding);
  for (std::size_t r = 0; r < rows.count; ++r) {
    const TileRow row(plan, rows.first + r);
    const SeenRows in_image(plan, row);
    const float* channel = x + (row.image * s.in_channels + c) * s.in_pixels();
    PrefetchRows(plan, rows.first + r + 2, x, c);
    // Pads all rows before splitting any, so that loads do not stall on recent stores.
    CopyStrip(channel + in_image[in_image.begin] * s.in_width, s.in_width, seen,
              in_image.end - in_image.begin, padded + in_image.begin * pitch + s.padding, pitch);
    for (std::size_t i = 0; i < plan.span; ++i) {
      float* to = places + i * plan.span * rows.pitch + r * plan.tiles_across;
      if (in_image.Has(i)) {
        DealRow(plan, padded + i * pitch, rows.pitch, to);
      } else {
        for (std::size_t j = 0; j < plan.span; ++j) {
          std::fill_n(to + j * rows.pitch, plan.tiles_across, 0.0f);
        }
      }
    }
  }
  for (std::size_t place = 0; place < plan.span * plan.span; ++place) {
    std::fill(places + place * rows.pitch + rows.tiles, places + place * rows.pitch + rows.padded,
              0.0f);
  }
}

// One channel's pass between places and transformed values, in either direction.
struct ChannelPass {
  const WinogradPlan& plan;
  const TileRows& rows;
  const SlotLayout& layout;
  std::size_t channel;
};

// Addresses of the values of phase (a, b): place and slot (i, j) of the first panel, and the
// distance to the slot's next panel.
struct PhaseAddress {
  PhaseAddress(const ChannelPass& pass, std::size_t a, std::size_t b) {
    const WinogradPlan& plan = pass.plan;
    for (std::size_t i = 0; i <= plan.taps(a); ++i) {
      for (std::size_t j = 0; j <= plan.taps(b); ++j) {
        const std::size_t s = i * plan.axis_slots + j;
        place[i][j] = ((a + i * plan.stride) * plan.span + b + j * plan.stride) * pass.rows.pitch;
        const std::size_t index = plan.phase_index(s, a, b) * plan.s.in_channels + pass.channel;
        slot[i][j] = pass.layout.At(s, index, 0);
        slot_step[i][j] = pass.layout.panel_stride[s];
      }
    }
  }
  std::size_t place[4][4], slot[4][4], slot_step[4][4];
};

template <std::size_t Ra, std::size_t Rb>
struct TransformPhase {
  static HWY_INLINE void Run(const PhaseAddress& at, std::size_t panels, const float* places,
                             float* values) {
    for (std::size_t panel = 0; panel < panels; ++panel) {
      for (std::size_t v = 0; v < kTileVectors; ++v) {
        const float* from = places + panel * kTileColumns + v * kLanes;
        Square in, out;
        for (std::size_t i = 0; i <= Ra; ++i) {
          for (std::size_t j = 0; j <= Rb; ++j) in[i][j] = hn::LoadU(Tag(), from + at.place[i][j]);
        }
        Transform<DataTransform<Ra>, DataTransform<Rb>>(in, out);
        float* to = values + v * kLanes;
        for (std::size_t i = 0; i <= Ra; ++i) {
          for (std::size_t j = 0; j <= Rb; ++j) {
            float* slot = to + at.slot[i][j] + panel * at.slot_step[i][j];
            hn::StoreU(out[i][j], Tag(), slot);
            // Of the next channel, or of the next panel.
            if (v * kLanes % kLineFloats == 0) PrefetchLineToWrite(slot + kTileColumns);
          }
        }
      }
    }
  }
};

template <std::size_t Ra, std::size_t Rb>
struct TransformPhaseBack {
  static HWY_INLINE void Run(const PhaseAddress& at, std::size_t panels, const float* values,
                             float* places) {
    for (std::size_t panel = 0; panel < panels; ++panel) {
      for (std::size_t v = 0; v < kTileVectors; ++v) {
        const float* from = values + v * kLanes;
        Square in, out;
        for (std::size_t i = 0; i <= Ra; ++i) {
          for (std::size_t j = 0; j <= Rb; ++j) {
            in[i][j] = hn::LoadU(Tag(), from + at.slot[i][j] + panel * at.slot_step[i][j]);
          }
        }
        Transform<DataAdjoint<Ra>, DataAdjoint<Rb>>(in, out);
        float* to = places + panel * kTileColumns + v * kLanes;
        for (std::size_t i = 0; i <= Ra; ++i) {
          for (std::size_t j = 0; j <= Rb; ++j) hn::StoreU(out[i][j], Tag(), to + at.place[i][j]);
        }
      }
    }
  }
};

template <template <std::size_t, std::size_t> class Body>
HWY_INLINE void ForPhases(const ChannelPass& pass, const float* from, float* to) {
  for (std::size_t a = 0; a < pass.plan.stride; ++a) {
    for (std::size_t b = 0; b < pass.plan.stride; ++b) {
      ForTaps<Body>(pass.plan.taps(a), pass.plan.taps(b), PhaseAddress(pass, a, b),
                    pass.rows.padded / kTileColumns, from, to);
    }
  }
}

inline void SumRow(const WinogradPlan& plan, const float* places, std::size_t pitch,
                   float* padded) {
  const RowOfTiles row{plan.tiles_across, pitch, plan.overlap};
  plan.step == 2 ? SumRow<2>(places, row, padded) : SumRow<4>(places, row, padded);
}

// Sums the places of one channel of one row of tiles. Image rows shared with the tiles above were
// already written by them.
inline void ScatterTileRow(const WinogradPlan& plan, const TileRow& row, const float* places,
                           std::size_t pitch, float* channel, float* padded) {
  const Conv2dShape& s = plan.s;
  const SeenRows in_image(plan, row);
  const std::size_t padded_pitch = PaddedPitch(plan);
  // Of the padded row.
  const std::size_t width = std::min(s.in_width, plan.step * (plan.tiles_across + 1) - s.padding);
  // Sums all rows before writing any to the image, so that loads do not stall on recent stores.
  for (std::size_t i = in_image.begin; i < in_image.end; ++i) {
    SumRow(plan, places + i * plan.span * pitch, pitch, padded + i * padded_pitch);
  }
  for (std::size_t i = in_image.begin; i < in_image.end; ++i) {
    float* out = channel + in_image[i] * s.in_width;
    const float* sums = padded + i * padded_pitch + s.padding;
    if (i < plan.overlap && row.down > 0) {
      for (std::size_t w = 0; w < width; ++w) out[w] += sums[w];
    } else {
      CopyStrip(sums, 0, width, 1, out, 0);
      std::fill(out + width, out + s.in_width, 0.0f);
    }
  }
}

inline void ScatterInputGrad(const WinogradPlan& plan, const TileRows& rows, const float* places,
                             std::size_t c, float* d_x, float* padded) {
  const Conv2dShape& s = plan.s;
  for (std::size_t r = 0; r < rows.count; ++r) {
    const TileRow row(plan, rows.first + r);
    float* channel = d_x + (row.image * s.in_channels + c) * s.in_pixels();
    ScatterTileRow(plan, row, places + r * plan.tiles_across, rows.pitch, channel, padded);
    if (row.down + 1 < plan.tiles_down) continue;
    // No output depends on the rows below the last tiles.
    const std::size_t end =
        std::min(s.in_height, plan.step * plan.tiles_down + plan.overlap - s.padding);
    std::fill(channel + end * s.in_width, channel + s.in_pixels(), 0.0f);
  }
}

// ---- Outputs: tiles of 2 x 2, lanes along tiles ----

// quads[i * 2 + j][t] = pixel (2 ty + i, 2 tx + j) of output channel o, 0 outside the image.
inline void GatherOutputGrad(const WinogradPlan& plan, const TileRows& rows, const float* d_y,
                             std::size_t o, float* quads) {
  const Conv2dShape& s = plan.s;
  std::fill_n(quads, 4 * rows.pitch, 0.0f);
  for (std::size_t r = 0; r < rows.count; ++r) {
    const TileRow row(plan, rows.first + r);
    for (std::size_t i = 0; i < std::min<std::size_t>(2, s.out_height() - 2 * row.down); ++i) {
      const float* from = d_y + (row.image * s.out_channels + o) * s.out_pixels() +
                          (2 * row.down + i) * s.out_width();
      float* even = quads + 2 * i * rows.pitch + r * plan.tiles_across;
      float* odd = even + rows.pitch;
      SplitPairs(from, s.out_width() / 2, even, odd);
      if (s.out_width() % 2 == 1) even[s.out_width() / 2] = from[s.out_width() - 1];
    }
  }
}

inline void ScatterOutput(const WinogradPlan& plan, const TileRows& rows, const float* quads,
                          std::size_t o, float* y) {
  const Conv2dShape& s = plan.s;
  for (std::size_t r = 0; r < rows.count; ++r) {
    const TileRow row(plan, rows.first + r);
    for (std::size_t i = 0; i < std::min<std::size_t>(2, s.out_height() - 2 * row.down); ++i) {
      float* to = y + (row.image * s.out_channels + o) * s.out_pixels() +
                  (2 * row.down + i) * s.out_width();
      const float* even = quads + 2 * i * rows.pitch + r * plan.tiles_across;
      const float* odd = even + rows.pitch;
      JoinPairs(even, odd, s.out_width() / 2, to);
      if (s.out_width() % 2 == 1) to[s.out_width() - 1] = even[s.out_width() / 2];
    }
  }
}

template <std::size_t kSlots>
HWY_INLINE void TransformOutput(const TileRows& rows, const SlotLayout& layout, std::size_t o,
                                float bias, const float* values, float* quads) {
  const Vec offset = hn::Set(Tag(), bias);
  for (std::size_t t = 0; t < rows.padded; t += kLanes) {
    Square in, out;
    for (std::size_t slot = 0; slot < kSlots * kSlots; ++slot) {
      in[slot / kSlots][slot % kSlots] = hn::LoadU(Tag(), values + layout.At(slot, o, 0) + t);
    }
    Transform<OutputTransform<kSlots>, OutputTransform<kSlots>>(in, out);
    for (std::size_t q = 0; q < 4; ++q) {
      hn::StoreU(hn::Add(out[q / 2][q % 2], offset), Tag(), quads + q * rows.pitch + t);
    }
  }
}

template <std::size_t kSlots>
HWY_INLINE void TransformOutputGrad(const TileRows& rows, const SlotLayout& layout, std::size_t o,
                                    const float* quads, float* values) {
  for (std::size_t t = 0; t < rows.padded; t += kLanes) {
    Square in, out;
    for (std::size_t q = 0; q < 4; ++q) {
      in[q / 2][q % 2] = hn::LoadU(Tag(), quads + q * rows.pitch + t);
    }
    Transform<OutputAdjoint<kSlots>, OutputAdjoint<kSlots>>(in, out);
    for (std::size_t slot = 0; slot < kSlots * kSlots; ++slot) {
      float* to = values + layout.At(slot, o, t / kTileColumns) + t % kTileColumns;
      hn::StoreU(out[slot / kSlots][slot % kSlots], Tag(), to);
      PrefetchLineToWrite(to + kTileColumns);  // address of the next channel's
    }
  }
}

// ---- Outputs: lanes along channels ----

inline std::size_t TileRowQuadsSize(const WinogradPlan& plan) {
  return 4 * plan.tiles_across * kTileColumns;
}

// quads[(i * width + x)][lane] = pixel (2 ty + i, x) of channel o + lane of one row of tiles.
inline void GatherChannels(const WinogradPlan& plan, const TileRow& row, const float* d_y,
                           std::size_t o, float* quads) {
  const Conv2dShape& s = plan.s;
  const std::size_t width = 2 * plan.tiles_across;
  std::fill_n(quads, TileRowQuadsSize(plan), 0.0f);
  const float* from = d_y + (row.image * s.out_channels + o) * s.out_pixels();
  for (std::size_t i = 0; i < std::min<std::size_t>(2, s.out_height() - 2 * row.down); ++i) {
    TransposeStrip(from + (2 * row.down + i) * s.out_width(), s.out_pixels(),
                   std::min(kTileColumns, s.out_channels - o), s.out_width(),
                   quads + i * width * kTileColumns, kTileColumns);
  }
}

// values[slot][t][lane], slots `slot_stride` apart, for the tiles of one row.
template <std::size_t kSlots>
HWY_INLINE void TransformChannels(const WinogradPlan& plan, const float* quads,
                                  std::size_t slot_stride, float* values) {
  const std::size_t below = 2 * plan.tiles_across * kTileColumns;
  for (std::size_t t = 0; t < plan.tiles_across; ++t) {
    for (std::size_t v = 0; v < kTileColumns; v += kLanes) {
      const float* from = quads + 2 * t * kTileColumns + v;
      Square in, out;
      for (std::size_t q = 0; q < 4; ++q) {
        in[q / 2][q % 2] = hn::LoadU(Tag(), from + q / 2 * below + q % 2 * kTileColumns);
      }
      Transform<OutputAdjoint<kSlots>, OutputAdjoint<kSlots>>(in, out);
      for (std::size_t slot = 0; slot < kSlots * kSlots; ++slot) {
        hn::StoreU(out[slot / kSlots][slot % kSlots], Tag(),
                   values + slot * slot_stride + t * kTileColumns + v);
      }
    }
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
