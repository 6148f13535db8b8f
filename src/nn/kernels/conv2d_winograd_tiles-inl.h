// SPDX-License-Identifier: Apache-2.0
// Between images and transformed values. Images are first dealt out to one array for each place
// of a tile, with the tiles side by side, so that the transforms are arithmetic on whole vectors
// whatever the size of an image.

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

#include "nn/kernels/conv2d_winograd_transform-inl.h"
#include "nn/kernels/winograd_plan.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kMaxSlots = 16;

// Where the values of each slot of one side lie: value `index` of panel `panel` of tiles.
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

// Enough for either.
inline std::size_t SlotLayoutSize(const WinogradSide& side, const TileRows& rows) {
  return side.total() * rows.pitch + side.plan.slots() * kTileColumns;
}

// ---- Inputs: tiles of span x span at distance `step`
// -----------------------------------------

// Memory of one worker: [span * span][pitch] for the places of a tile, and one padded image row.
inline std::size_t PlacesSize(const WinogradPlan& plan, const TileRows& rows) {
  return plan.span * plan.span * rows.pitch;
}
inline std::size_t PaddedRowSize(const WinogradPlan& plan) {
  return RoundUp(plan.step * plan.tiles_across + plan.span, kTileColumns);
}

// places[j][t] = padded[t step + j]
template <std::size_t kSpan, std::size_t kStep>
HWY_INLINE void DealRow(const float* padded, std::size_t tiles, std::size_t pitch, float* places) {
  for (std::size_t t = 0; t < tiles; ++t, padded += kStep) {
    for (std::size_t j = 0; j < kSpan; ++j) places[j * pitch + t] = padded[j];
  }
}

inline void DealRow(const WinogradPlan& plan, const float* padded, std::size_t pitch,
                    float* places) {
  const std::size_t tiles = plan.tiles_across;
  if (plan.span == 4) return DealRow<4, 2>(padded, tiles, pitch, places);
  if (plan.span == 6) return DealRow<6, 4>(padded, tiles, pitch, places);
  DealRow<7, 4>(padded, tiles, pitch, places);
}

// All places of channel c of the input.
inline void GatherInput(const WinogradPlan& plan, const TileRows& rows, const float* x,
                        std::size_t c, float* places, float* padded) {
  const Conv2dShape& s = plan.s;
  std::fill_n(padded, PaddedRowSize(plan), 0.0f);
  // What a tile sees of a row: not more than the row, not more than the padded one has.
  const std::size_t seen =
      std::min(s.in_width, plan.step * (plan.tiles_across - 1) + plan.span - s.padding);
  for (std::size_t r = 0; r < rows.count; ++r) {
    const TileRow row(plan, rows.first + r);
    const float* channel = x + (row.image * s.in_channels + c) * s.in_pixels();
    for (std::size_t i = 0; i < plan.span; ++i) {
      float* to = places + i * plan.span * rows.pitch + r * plan.tiles_across;
      const std::size_t h = row.down * plan.step + i - s.padding;  // wraps above the image
      if (h >= s.in_height) {
        for (std::size_t j = 0; j < plan.span; ++j) {
          std::fill_n(to + j * rows.pitch, plan.tiles_across, 0.0f);
        }
        continue;
      }
      std::copy_n(channel + h * s.in_width, seen, padded + s.padding);
      DealRow(plan, padded, rows.pitch, to);
    }
  }
  for (std::size_t place = 0; place < plan.span * plan.span; ++place) {
    std::fill(places + place * rows.pitch + rows.tiles, places + place * rows.pitch + rows.padded,
              0.0f);
  }
}

// One channel's pass between places and transformed values, or back.
struct ChannelPass {
  const WinogradPlan& plan;
  const TileRows& rows;
  const SlotLayout& layout;
  std::size_t channel;
};

// Where the values of phase (a, b) lie: place and slot (i, j) of the first panel, and how far it is
// to the slot's next panel.
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
            hn::StoreU(out[i][j], Tag(), to + at.slot[i][j] + panel * at.slot_step[i][j]);
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

// One row of places of one row of tiles, summed where tiles overlap, as a padded image row.
inline void SumRow(const WinogradPlan& plan, const float* places, std::size_t pitch,
                   float* padded) {
  const std::size_t tiles = plan.tiles_across;
  for (std::size_t j = 0; j < plan.step; ++j) {
    const float* own = places + j * pitch;
    for (std::size_t t = 0; t < tiles; ++t) padded[t * plan.step + j] = own[t];
    padded[tiles * plan.step + j] = 0.0f;
    if (j >= plan.overlap) continue;
    const float* left = own + plan.step * pitch;  // what the tile to the left adds
    for (std::size_t t = 0; t < tiles; ++t) padded[(t + 1) * plan.step + j] += left[t];
  }
}

// Adds up the places of one channel of one row of tiles. Rows of the image that the tiles above
// have a share in were written by them.
inline void ScatterTileRow(const WinogradPlan& plan, const TileRow& row, const float* places,
                           std::size_t pitch, float* channel, float* padded) {
  const Conv2dShape& s = plan.s;
  const std::size_t width =
      std::min(s.in_width, plan.step * (plan.tiles_across + 1) - s.padding);  // of the padded row
  for (std::size_t i = 0; i < plan.span; ++i) {
    const std::size_t h = row.down * plan.step + i - s.padding;  // wraps above the image
    if (h >= s.in_height) continue;
    float* out = channel + h * s.in_width;
    SumRow(plan, places + i * plan.span * pitch, pitch, padded);
    const float* sums = padded + s.padding;
    if (i < plan.overlap && row.down > 0) {
      for (std::size_t w = 0; w < width; ++w) out[w] += sums[w];
    } else {
      std::copy_n(sums, width, out);
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
    // No output sees the rows below the last tiles.
    const std::size_t end =
        std::min(s.in_height, plan.step * plan.tiles_down + plan.overlap - s.padding);
    std::fill(channel + end * s.in_width, channel + s.in_pixels(), 0.0f);
  }
}

// ---- Outputs: tiles of 2 x 2, lanes along tiles
// -----------------------------------------------

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
      for (std::size_t t = 0; t < s.out_width() / 2; ++t) {
        even[t] = from[2 * t];
        odd[t] = from[2 * t + 1];
      }
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
      for (std::size_t t = 0; t < s.out_width() / 2; ++t) {
        to[2 * t] = even[t];
        to[2 * t + 1] = odd[t];
      }
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
      hn::StoreU(out[slot / kSlots][slot % kSlots], Tag(),
                 values + layout.At(slot, o, t / kTileColumns) + t % kTileColumns);
    }
  }
}

// ---- Outputs: lanes along channels
// ------------------------------------------------------------

inline std::size_t TileRowQuadsSize(const WinogradPlan& plan) {
  return 4 * plan.tiles_across * kTileColumns;
}

// quads[(i * width + x)][lane] = pixel (2 ty + i, x) of channel o + lane of one row of tiles.
inline void GatherChannels(const WinogradPlan& plan, const TileRow& row, const float* d_y,
                           std::size_t o, float* quads) {
  const Conv2dShape& s = plan.s;
  const std::size_t width = 2 * plan.tiles_across;
  std::fill_n(quads, TileRowQuadsSize(plan), 0.0f);
  for (std::size_t lane = 0; lane < std::min(kTileColumns, s.out_channels - o); ++lane) {
    for (std::size_t i = 0; i < std::min<std::size_t>(2, s.out_height() - 2 * row.down); ++i) {
      const float* from = d_y + (row.image * s.out_channels + o + lane) * s.out_pixels() +
                          (2 * row.down + i) * s.out_width();
      float* to = quads + i * width * kTileColumns + lane;
      for (std::size_t x = 0; x < s.out_width(); ++x) to[x * kTileColumns] = from[x];
    }
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
