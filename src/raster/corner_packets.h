// SPDX-License-Identifier: Apache-2.0
// Screen positions of face corners, packed for vector loads while faces are set up. Code with faces
// in its lanes loads them from here instead of gathering.
#pragma once

#include <cstddef>

#include "base/aligned.h"

namespace tilegrad::raster {

inline constexpr std::size_t kPacketFaces = 16;   // no vector has more lanes of floats
inline constexpr std::size_t kCornerNumbers = 6;  // per face: x of corners 0, 1, 2, then y
inline constexpr std::size_t kPacketGroup = 16;   // room for a multiple of this many packets

// Coordinate of faces outside the soft mask and of padding in the last packets: beyond the reach of
// every kernel.
inline constexpr float kNowhere = 3e38f;

// [packet][kCornerNumbers][kPacketFaces], pixels. A packet is loaded as a whole.
struct CornerPackets {
  AlignedVector<float> values;

  static constexpr std::size_t PacketsOf(std::size_t faces) {
    constexpr std::size_t kFaces = kPacketGroup * kPacketFaces;
    return (faces + kFaces - 1) / kFaces * kPacketGroup;
  }
  std::size_t packets() const { return values.size() / (kCornerNumbers * kPacketFaces); }
  // Reuses memory.
  void Resize(std::size_t faces) {
    values.resize(PacketsOf(faces) * kCornerNumbers * kPacketFaces);
  }
  // One of the corner numbers for a packet's faces.
  float* at(std::size_t packet, std::size_t number) { return values.data() + At(packet, number); }
  const float* at(std::size_t packet, std::size_t number) const {
    return values.data() + At(packet, number);
  }

 private:
  static std::size_t At(std::size_t packet, std::size_t number) {
    return (kCornerNumbers * packet + number) * kPacketFaces;
  }
};

}  // namespace tilegrad::raster
