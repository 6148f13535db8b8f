// SPDX-License-Identifier: Apache-2.0
// The transformed values of a convolution by F(2 x 2, r x r), and their layout.
//
// Along an axis a tile of 2 outputs depends on `span` = kernel + stride inputs: those of phase a
// are a, a + stride, .. and give taps(a) + 1 transformed values, one per evaluation point, the
// slots: 0, 1, infinity and, with 3 taps, -1. A slot's products of all phases go into the same sum,
// since the output's transform depends on the slot only.
#pragma once

#include <algorithm>
#include <cstddef>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/panels.h"

namespace tilegrad::nn {

struct WinogradPlan {
  explicit WinogradPlan(const Conv2dShape& shape)
      : s(shape),
        kernel(s.kernel_height),
        stride(s.stride),
        span(kernel + stride),
        step(2 * stride),
        overlap(span - step),
        long_phases(kernel > 2 * stride ? kernel - 2 * stride : 0),
        axis_slots(long_phases > 0 ? 4 : 3),
        tiles_down(DivideUp(s.out_height(), 2)),
        tiles_across(DivideUp(s.out_width(), 2)) {}

  std::size_t taps(std::size_t phase) const { return DivideUp(kernel - phase, stride); }
  std::size_t slots() const { return axis_slots * axis_slots; }
  // Phases of one axis that have a slot: all, or only the first ones, which have 3 taps.
  std::size_t axis_phases(std::size_t axis_slot) const {
    return axis_slot == 3 ? long_phases : stride;
  }
  // Phases (a, b) that have slot (i, j) = (slot / axis_slots, slot % axis_slots).
  std::size_t phases(std::size_t slot) const {
    return axis_phases(slot / axis_slots) * axis_phases(slot % axis_slots);
  }
  std::size_t phase_index(std::size_t slot, std::size_t a, std::size_t b) const {
    return a * axis_phases(slot % axis_slots) + b;
  }
  // The same, counted over all slots before this one.
  std::size_t phases_before(std::size_t slot) const {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < slot; ++i) sum += phases(i);
    return sum;
  }
  std::size_t tile_rows() const { return s.batch * tiles_down; }

  Conv2dShape s;
  std::size_t kernel, stride;
  std::size_t span, step, overlap;  // inputs of a tile; distance to the next tile; inputs shared
                                    // with it
  std::size_t long_phases;          // phases of 3 taps; they come first
  std::size_t axis_slots;
  std::size_t tiles_down, tiles_across;  // of one image
};

// The values of one side of the convolution, by slot: (phase, input channel), or output channel.
struct WinogradSide {
  const WinogradPlan& plan;
  bool input;

  std::size_t channels() const { return input ? plan.s.in_channels : plan.s.out_channels; }
  std::size_t groups(std::size_t slot) const { return input ? plan.phases(slot) : 1; }
  std::size_t size(std::size_t slot) const { return groups(slot) * channels(); }
  std::size_t before(std::size_t slot) const {  // values of all slots before this one
    return (input ? plan.phases_before(slot) : slot) * channels();
  }
  std::size_t total() const { return before(plan.slots()); }
};

// Some rows of tiles, possibly of several images, concatenated and padded to whole panels of
// columns.
struct TileRows {
  TileRows(const WinogradPlan& plan, std::size_t first_row, std::size_t rows, std::size_t panel)
      : first(first_row),
        count(rows),
        tiles(rows * plan.tiles_across),
        padded(RoundUp(tiles, panel)),
        pitch(padded + panel) {}
  std::size_t first, count;
  std::size_t tiles, padded;
  std::size_t pitch;  // between rows of values: not a power of 2, which would thrash caches
};

// One row of tiles: row `down` of the tiles of an image.
struct TileRow {
  TileRow(const WinogradPlan& plan, std::size_t index)
      : image(index / plan.tiles_down), down(index % plan.tiles_down) {}
  std::size_t image, down;
};

}  // namespace tilegrad::nn
