// SPDX-License-Identifier: Apache-2.0
// The faces of an image that take part in the soft mask, in a hierarchy of boxes: a node holds
// kNodeFaces faces, a group kGroupNodes nodes. A tile drops whole groups and nodes that are far
// from its background, and takes what remains near ones first.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

inline constexpr std::size_t kNodeFaces = 16;
inline constexpr std::size_t kGroupNodes = 16;
inline constexpr std::size_t kNodeCorners = 6;  // numbers of a face
inline constexpr std::size_t kGroupFaces = kNodeFaces * kGroupNodes;

// Coordinate of faces that do not take part: beyond the reach of every kernel.
inline constexpr float kNowhere = 3e38f;

// Boxes and how many faces are in them, as structure of arrays.
struct SoftBoxes {
  enum Array { kLeft, kTop, kRight, kBottom, kFaces, kArrays };
  AlignedVector<float> values;
  std::size_t stride = 0, count = 0;

  void Resize(std::size_t n) {
    count = n, stride = (n + kGroupNodes - 1) / kGroupNodes * kGroupNodes;
    values.resize(kArrays * stride);
  }
  float* array(std::size_t a) { return values.data() + a * stride; }
  const float* array(std::size_t a) const { return values.data() + a * stride; }
};

struct SoftTree {
  std::size_t faces = 0;  // that take part
  // [node][6][kNodeFaces] x of corners 0, 1, 2, then y; pixels. A node is read as a whole.
  AlignedVector<float> corners;
  SoftBoxes nodes, groups;

  // The first face of a node.
  float* corner(std::size_t node, std::size_t a) { return corners.data() + At(node, a); }
  const float* corner(std::size_t node, std::size_t a) const {
    return corners.data() + At(node, a);
  }

 private:
  static std::size_t At(std::size_t node, std::size_t a) {
    return (kNodeCorners * node + a) * kNodeFaces;
  }
};

// Reuses the memory of `tree`. `workers` null: the calling thread.
void BuildSoftTree(const ScreenMesh& mesh, SoftTree* tree, const Workers* workers = nullptr);

}  // namespace tilegrad::raster
