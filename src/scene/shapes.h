// SPDX-License-Identifier: Apache-2.0
// Built-in shapes, so that tests and demos need no files. All are closed, counter-clockwise seen
// from outside, y up, with positions and faces only; colour them with SetColor.
#pragma once

#include "base/function_ref.h"
#include "scene/mesh.h"

namespace tilegrad {

// A subdivided icosahedron: 10 * 4^level + 2 vertices, 20 * 4^level faces, all at `radius` from the
// origin. Level 3 is the paper's template (642 vertices, 1,280 faces). The 12 first vertices are
// those of the icosahedron, then the edge midpoints level by level in order of first use;
// coordinates that are zero by symmetry are exactly zero. level in [0, 8].
Mesh Icosphere(int level, float radius);

Mesh Box(glm::vec3 centre, glm::vec3 size);  // 8 vertices, 12 faces
// Around the y axis through `centre` (its middle), with end caps; radius_top = 0 makes a cone.
// segments >= 3.
Mesh Frustum(glm::vec3 centre, float radius_bottom, float radius_top, float height, int segments);
// Around the y axis; `major` from the centre to the tube's middle. Both counts >= 3.
Mesh Torus(float major, float minor, int major_segments, int minor_segments);
// Rings from pole to pole along y. rings >= 2, segments >= 3.
Mesh UvSphere(float radius, int rings, int segments);

// The same colour (0..1) for every vertex.
void SetColor(Mesh& mesh, glm::vec4 color);
// Adds `other` behind `mesh`: indices, materials and textures are renumbered. An array that only
// one of the two has is filled for the other with a default (white, zero uv, geometric normal), so
// the result is valid if both were.
void Append(Mesh& mesh, const Mesh& other);
// Applies p -> linear * p + offset to positions, and the inverse transpose to normals. Columns of
// `linear` are the images of the axes.
void Transform(Mesh& mesh, const std::array<glm::vec3, 3>& linear, glm::vec3 offset);
// Per-vertex unit normals: the area-weighted sum of the adjacent faces' normals; (0, 0, 1) where
// that is zero.
std::vector<glm::vec3> SmoothNormals(const Mesh& mesh);

// `middle(a, b)` makes the vertex between a < b, once for each edge in order of first use, and
// returns its index. Face (a, b, c) becomes those at a, b and c, then the one in the middle.
std::vector<Face> SplitFaces(const std::vector<Face>& faces,
                             FunctionRef<std::int32_t(std::int32_t a, std::int32_t b)> middle);

// `mesh` with every face divided; new positions, vertex colours and texture coordinates are the
// means of their edge's ends. A single material and its textures stay; other arrays are left out.
Mesh Subdivided(const Mesh& mesh);

}  // namespace tilegrad
