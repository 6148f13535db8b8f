// SPDX-License-Identifier: Apache-2.0
// The small coloured mesh that a dataset keeps of each model, and a fingerprint of its shape.
#pragma once

#include <cstdint>

#include "scene/mesh.h"

namespace tilegrad::train {

// Positions, faces and per-vertex unlit colours. Vertices are shared per (vertex, material); their
// colour is the mean over their corners. If there are more than `max_faces` faces: vertex
// clustering on a grid over the bounding box, with the finest of 160, 128, 102, ... cells along
// the longest side (each four fifths of the one before) that leaves at most that many; a cluster
// stands at its mean, and faces that collapse or double another are dropped.
Mesh MakeTruthMesh(const Mesh& mesh, std::size_t max_faces);

// The same clustering of a mesh that keeps its texture coordinates and materials: each corner has
// what it had. Stops before nothing is left.
void ClusterFaces(std::size_t max_faces, Mesh* mesh);

// The same for any order of faces and vertices, and for any colours. Never 0. Of a normalised mesh,
// positions rounded to 1e-4.
std::uint64_t GeometryFingerprint(const Mesh& mesh);

}  // namespace tilegrad::train
