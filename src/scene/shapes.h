// SPDX-License-Identifier: Apache-2.0
// Built-in shapes, so that tests and demos need no files. All are closed, counter-clockwise seen
// from outside, y up, with positions and faces only; colour them with SetColor.
#pragma once

#include <array>
#include <vector>

#include "base/function_ref.h"
#include "scene/mesh.h"

namespace tilegrad {

// A subdivided icosahedron: 10 * 4^level + 2 vertices, 20 * 4^level faces, all at `radius` from the
// origin. Level 3 is the paper's template (642 vertices, 1,280 faces). The first 12 vertices are
// those of the icosahedron, then edge midpoints level by level in order of first use; coordinates
// that are zero by symmetry are exactly zero. level in [0, 8].
Mesh Icosphere(int level, float radius);

Mesh Box(glm::vec3 centre, glm::vec3 size);  // 8 vertices, 12 faces
// Around the y axis through `centre` (its middle), with end caps; radius_top = 0 makes a cone.
// segments >= 3.
Mesh Frustum(glm::vec3 centre, float radius_bottom, float radius_top, float height, int segments);
// Around the y axis; `major` is the radius to the tube's centre. Both counts >= 3.
Mesh Torus(float major, float minor, int major_segments, int minor_segments);
// Rings from pole to pole along y. rings >= 2, segments >= 3.
Mesh UvSphere(float radius, int rings, int segments);

// Sets the same colour (0..1) at every vertex.
void SetColor(Mesh& mesh, glm::vec4 color);
// Appends `other` to `mesh`, renumbering indices, materials and textures. Where only one of the two
// has an array, the other gets defaults (white, zero uv, geometric normal), so the result is valid
// if both were.
void Append(Mesh& mesh, const Mesh& other);
// Applies p -> linear * p + offset to positions, and the inverse transpose to normals. Columns of
// `linear` are the images of the axes.
void Transform(Mesh& mesh, const std::array<glm::vec3, 3>& linear, glm::vec3 offset);
// Per-vertex unit normals: the area-weighted sum of the adjacent faces' normals; (0, 0, 1) where
// that is zero.
std::vector<glm::vec3> SmoothNormals(const Mesh& mesh);

// `middle(a, b)` makes the vertex between a < b, called once per edge in order of first use, and
// returns its index. Face (a, b, c) becomes the faces at a, b and c, then the central one.
std::vector<Face> SplitFaces(const std::vector<Face>& faces,
                             FunctionRef<std::int32_t(std::int32_t a, std::int32_t b)> middle);

// `mesh` with every face split; new positions, vertex colours and texture coordinates are the means
// of their edge's ends. Keeps a single material and its textures; drops other arrays.
Mesh Subdivided(const Mesh& mesh);

// Texture coordinates for a template sphere.

// Longitude and latitude of each corner, [3F]: u = 1/2 + atan2(-z, x) / 2 pi goes once around the y
// axis, v from the lower pole (0) to the upper (1). `sphere` is centred on the origin. Faces across
// the seam extend beyond u = 1, where the texture repeats; a corner at a pole has the mean u of the
// other two, so no face is flipped in the map. Reflection at x = 0 maps u to 1/2 - u.
std::vector<glm::vec2> SphereUvs(const Mesh& sphere);

// A point on a mesh: its face, the vertices of the face, and weights that sum to 1.
struct SurfacePoint {
  std::int32_t face;
  Face vertices;
  std::array<float, 3> weights;
};

// The point of `sphere` at each texel of such a map, [height][width]: where the ray from the origin
// towards the texel's centre leaves the sphere. `sphere` must be convex around the origin, with
// faces counter-clockwise as seen from outside.
std::vector<SurfacePoint> SphereTexels(const Mesh& sphere, int width, int height);

}  // namespace tilegrad
