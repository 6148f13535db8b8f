// SPDX-License-Identifier: Apache-2.0
// The faces of an image that take part in the soft mask, in a hierarchy of boxes: a node holds
// kNodeFaces faces, a group kGroupNodes nodes. A tile drops whole groups and nodes that are far
// from its background, and visits the others nearest first.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/corner_packets.h"

namespace tilegrad::raster {

inline constexpr std::size_t kNodeFaces = kPacketFaces;
inline constexpr std::size_t kGroupNodes = kPacketGroup;
inline constexpr std::size_t kGroupFaces = kNodeFaces * kGroupNodes;

// Boxes and their face counts, as a structure of arrays.
struct SoftBoxes {
  enum Array { kLeft, kTop, kRight, kBottom, kFaces, kArrays };
  AlignedVector<float> values;
  std::size_t stride = 0, count = 0;

  void Resize(std::size_t n) {
    count = n;
    stride = (n + kGroupNodes - 1) / kGroupNodes * kGroupNodes;
    values.resize(kArrays * stride);
  }
  float* array(std::size_t a) { return values.data() + a * stride; }
  const float* array(std::size_t a) const { return values.data() + a * stride; }
};

struct SoftTree {
  std::size_t faces = 0;  // that take part
  CornerPackets corners;  // a node is a packet
  SoftBoxes nodes, groups;
};

// Builds the tree over `tree->corners`, filled by SetUpFaces. Reuses its memory. `workers` null:
// the calling thread.
void BuildSoftTree(SoftTree* tree, const Workers* workers = nullptr);

}  // namespace tilegrad::raster
