// SPDX-License-Identifier: Apache-2.0
// Holes of masks, true or false.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/camera.h"

namespace tilegrad::train {

// The dilation of a mask [H,W] in [0, 1], half or more being inside, by a square that reaches so
// many pixels to each side: 1 inside, 0 outside.
std::vector<std::uint8_t> Dilated(std::span<const float> mask, ImageSize size, int reach);

struct Hole {
  std::vector<std::size_t> core;    // pixels so far inside that no blur mixes them with the rim
  std::vector<std::size_t> pixels;  // all of it, the core included
};

// What `inside` [H,W] in [0, 1] does not cover and no way wider than four pixels joins to the
// image's border, where that has a core of eight pixels.
std::vector<Hole> HolesOf(std::span<const float> inside, ImageSize size);

}  // namespace tilegrad::train
