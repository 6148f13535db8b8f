// SPDX-License-Identifier: Apache-2.0
// The small coloured mesh that a dataset keeps of each model, and a fingerprint of its shape.
#pragma once

#include <cstdint>

#include "scene/mesh.h"

namespace tilegrad::train {

// Positions, faces and per-vertex unlit colours. Vertices are shared per (vertex, material), in the
// mean colour of their corners. More than `max_faces` faces are clustered on the finest grid of
// 160, 128, 102, ... cells along the longest side (each four fifths of the one before) that leaves
// no more; each cluster moves to its mean; collapsed and duplicate faces are dropped.
Mesh MakeTruthMesh(const Mesh& mesh, std::size_t max_faces);

// The same clustering, but each corner keeps its texture coordinates and material. Stops before
// nothing is left.
void ClusterFaces(std::size_t max_faces, Mesh* mesh);

// Independent of the order of faces and vertices and of colours; never 0. For a normalised mesh;
// rounds positions to 1e-4.
std::uint64_t GeometryFingerprint(const Mesh& mesh);

}  // namespace tilegrad::train
