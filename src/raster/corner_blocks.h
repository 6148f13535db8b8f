// SPDX-License-Identifier: Apache-2.0
// Where the corners of an image's faces are on the screen, gathered while faces are set up: who
// looks at faces by the vector reads them from here.
#pragma once

#include <cstddef>

#include "base/aligned.h"

namespace tilegrad::raster {

inline constexpr std::size_t kBlockFaces = 16;    // no vector has more lanes of floats
inline constexpr std::size_t kCornerNumbers = 6;  // of a face: x of corners 0, 1, 2, then y
inline constexpr std::size_t kTogether = 16;      // there is room for a multiple of so many blocks

// Coordinate of faces that do not take part in the soft mask, and of those that fill up the last
// blocks: beyond the reach of every kernel.
inline constexpr float kNowhere = 3e38f;

// [block][kCornerNumbers][kBlockFaces], pixels. A block is read as a whole.
struct CornerBlocks {
  AlignedVector<float> values;

  static constexpr std::size_t BlocksOf(std::size_t faces) {
    constexpr std::size_t kFaces = kTogether * kBlockFaces;
    return (faces + kFaces - 1) / kFaces * kTogether;
  }
  std::size_t blocks() const { return values.size() / (kCornerNumbers * kBlockFaces); }
  // Reuses the memory.
  void Resize(std::size_t faces) { values.resize(BlocksOf(faces) * kCornerNumbers * kBlockFaces); }
  // One number of a block's faces.
  float* at(std::size_t block, std::size_t number) { return values.data() + At(block, number); }
  const float* at(std::size_t block, std::size_t number) const {
    return values.data() + At(block, number);
  }

 private:
  static std::size_t At(std::size_t block, std::size_t number) {
    return (kCornerNumbers * block + number) * kBlockFaces;
  }
};

}  // namespace tilegrad::raster
