// SPDX-License-Identifier: Apache-2.0
// Edges as long as they should be, on a surface that is being fitted: after W. Palfinger,
// Continuous remeshing for inverse rendering (2022).
#pragma once

#include <span>

#include "scene/edit_mesh.h"

namespace tilegrad {

struct RemeshLimits {
  // Edges, world units: shorter ones are collapsed, longer ones split, and those between busy
  // vertices if they are longer than `busy`, which is at least twice `shortest`.
  float shortest = 0, busy = 0, longest = 0;
  // Of collapses, as of scene/simplify.h: where the surface is flat, edges become long.
  float error = 0, patch = 1;
  std::size_t most_faces = 0;  // no edge is split beyond
};

struct RemeshCount {
  int split = 0, collapsed = 0, flipped = 0, unfolded = 0;
};

// `busy`: for each vertex, not 0 where the surface is still far from what it should be. In order,
// each deterministic:
//   vertices whose faces fold over each other move to the middle of their neighbours;
//   edges longer than `longest` are split, and busy ones longer than `busy`;
//   edges are collapsed, the least error first, where the surface is flat and not busy, or where
//   they are shorter than `shortest`; no face turns over;
//   edges are flipped where that makes the least angle larger and the surface is nearly flat.
// The topology stays as it is.
RemeshCount Remesh(const RemeshLimits& limits, std::span<const char> busy, EditMesh* mesh);

}  // namespace tilegrad
