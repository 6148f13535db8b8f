// SPDX-License-Identifier: Apache-2.0
// The faces of an image that take part in the soft mask, in a hierarchy of boxes: a node holds
// kNodeFaces faces, a group kGroupNodes nodes. A tile drops whole groups and nodes that are far
// from its background, and takes what remains near ones first.
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

// Boxes and how many faces are in them, as structure of arrays.
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

// The tree over `tree->corners`, which SetUpFaces has filled. Reuses its memory. `workers`
// null: the calling thread.
void BuildSoftTree(SoftTree* tree, const Workers* workers = nullptr);

}  // namespace tilegrad::raster
