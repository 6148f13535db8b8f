// SPDX-License-Identifier: Apache-2.0
// Mesh adjacency for the regularisers: edges with their faces, vertices with their
// neighbours.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

struct Edge {
  std::int32_t a, b;          // vertices, a < b
  std::int32_t face0, face1;  // adjacent faces; face1 = -1 at a boundary
};

struct Topology {
  // Each undirected edge once, sorted by (a, b); all three sides of every face count.
  std::vector<Edge> edges;
  // Edges with more than two faces; `edges` keeps the first two of them, in face order.
  int nonmanifold_edges = 0;
  int boundary_edges = 0;  // edges with one face
  // Neighbours of vertex v: neighbors[offsets[v] .. offsets[v + 1]), ascending.
  std::vector<std::int32_t> offsets;  // [V + 1]
  std::vector<std::int32_t> neighbors;
};

// Indices must be in [0, vertices). Ignores sides that join a vertex to itself.
Topology BuildTopology(std::span<const Face> faces, std::size_t vertices);

// Marks sharp edges for smooth normals.

// Makes smooth normals (per vertex, from positions) break at edges where faces meet at an angle of
// `degrees` or more: merges vertices at the same position into one per group of faces joined by
// smoother edges, however many the file had there. Faces and their corners keep their order; vertex
// colours become corner colours, vertex normals are dropped. The mesh must be valid.
void SplitAtCreases(double degrees, Mesh* mesh);

}  // namespace tilegrad
