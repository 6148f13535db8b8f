// SPDX-License-Identifier: Apache-2.0
// Where the face changes from a pixel to the next one: all that antialias.h looks at are those
// pixels, which are few.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "compat/nvdiffrast/clip_mesh.h"

namespace tilegrad::compat::nvdiffrast {

inline constexpr std::size_t kStepBits = 64;  // pixels of a word of steps

// The faces of a row of `width` pixels, as numbers of rast: face + 1, 0 for none.
struct FaceRow {
  // [W + kStepBits], of which number W is number W - 1 again: the last pixel has no step. The
  // others are there for whole vectors.
  AlignedVector<std::int32_t> ids;

  explicit FaceRow(std::size_t width) : ids(width + kStepBits) {}
};

// Reads channel 3 of a row of rast [W,4]. Returns the first pixel, counted from the start of the
// row, whose number is not an integer in [0, faces], or kNoPixel; these get 0.
std::size_t ReadFaceRow(std::span<const float> rast, std::size_t faces, FaceRow* out);

// steps [ceil(W / kStepBits)] <- bit x: pixel x has another face than pixel x + 1 of its row
// or pixel x of the row `above`.
void FindSteps(const FaceRow& row, const FaceRow& above, std::size_t width,
               std::span<std::uint64_t> steps);

}  // namespace tilegrad::compat::nvdiffrast
