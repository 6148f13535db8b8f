// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scene/camera.h"
#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad {

struct MeshTexture {
  std::string name;  // file name or label, for messages
  ImageU8 image;     // 3 or 4 channels; row 0 on top is v = 1
};

enum class TextureWrap { kRepeat, kMirror, kClamp };
enum class AlphaMode { kOpaque, kMask, kBlend };

// Colours are sRGB-encoded, like the pixels of images.
struct Material {
  std::string name;
  glm::vec4 base_color = {0.8f, 0.8f, 0.8f, 1.0f};  // multiplies texture; alpha < 1: transparent
  int base_color_texture = -1;                      // index into Mesh::textures, -1 for none
  std::array<TextureWrap, 2> wrap = {TextureWrap::kRepeat, TextureWrap::kRepeat};  // along u, v
  bool nearest = false;                       // texels as squares, not filtered
  AlphaMode alpha_mode = AlphaMode::kOpaque;  // as in the file
  float alpha_cutoff = 0.5f;                  // for kMask: texels with less alpha are discarded
  bool double_sided = true;                   // false: viewers cull its back faces
  bool unlit = false;                         // shown without lighting

  bool operator==(const Material&) const = default;
};

using Face = std::array<std::int32_t, 3>;

// A triangle mesh that owns its arrays. V vertices, F faces. Counter-clockwise faces seen from
// outside are front faces.
struct Mesh {
  std::vector<glm::vec3> positions;  // [V]
  std::vector<Face> faces;           // [F], indices in [0, V)

  // Per vertex; each is empty or has V entries.
  std::vector<glm::vec3> normals;  // unit
  std::vector<glm::vec4> colors;   // [0, 1]

  // Per corner; each is empty or has 3F entries (corner k of face f is 3f + k), so seams need no
  // doubled vertices.
  std::vector<glm::vec2> corner_uvs;  // u right, v up; (0, 0): the texture's lower left corner
  std::vector<glm::vec3> corner_normals;
  std::vector<glm::vec4> corner_colors;  // [0, 1]; replaces `colors`, which is then empty

  std::vector<std::int32_t> face_materials;  // empty (all 0) or [F], indices into materials
  std::vector<Material> materials;
  std::vector<MeshTexture> textures;
};

// OK, or an error that names the array and the index: sizes that do not match, an index out of
// range, a non-finite number.
Status Validate(const Mesh& mesh);

struct Bounds {
  glm::vec3 low, high;
};
// Over vertices used by faces. The mesh must be valid and have a face.
Bounds MeshBounds(const Mesh& mesh);

// Moves the centre of the bounding box to the origin and scales the largest half-extent to
// `half_extent` (datasets: 0.45). An error for an empty mesh or one without extent.
Status NormalizeToBox(Mesh& mesh, float half_extent);

// Keeps the faces whose entry in `keep` (one per face) is not 0, with their corner arrays.
// Vertices, materials and textures stay. Returns false and changes nothing if no face would remain.
bool KeepFaces(const std::vector<char>& keep, Mesh* mesh);

// For colours with baked lighting, such as those learned from images: makes materials unlit, so
// that no viewer shades them again. A mesh without materials gets a white one, `name`.
void SetUnlit(Mesh& mesh, const std::string& name);

// Meshes whose up axis is not +y: CAD and 3D printing have z up, some programs x. Rotates the mesh
// so that up is +y, as in glTF: for z, (x, y, z) becomes (x, z, -y), so that the front in such
// programs, -y, faces +z, where default cameras are; for x, (-y, x, z).

enum class UpAxis { kY, kZ, kX };

// "y", "z", "x", in either case; nullopt for other words.
std::optional<UpAxis> UpAxisNamed(std::string_view name);

// Rotates a point or a direction; exact, as all functions here.
glm::vec3 Upright(UpAxis up, glm::vec3 v);

// Rotates positions and normals.
void TurnUpright(UpAxis up, Mesh* mesh);

// For a camera relative to the mesh as in its file, the one with the same view of the mesh turned
// upright.
Camera UprightCamera(UpAxis up, Camera camera);

// The inverse of UprightCamera.
Camera CameraOfFile(UpAxis up, Camera camera);

// Triangulates a simple polygon, convex or not, planar or nearly so, by ear clipping: n - 2
// triangles with the polygon's orientation. Sets `triangles` to indices into `corners`; fewer than
// three corners give none. A convex polygon becomes the fan around its corner 0, and so does a
// remainder without ears (the polygon crosses itself or has no area) and a polygon of more than 256
// corners, since the search for ears takes cubic time at worst.
void TriangulatePolygon(std::span<const glm::vec3> corners, std::vector<Face>& triangles);

// Default cameras that frame a whole mesh.

// Degrees, as for OrbitCamera: azimuth 90 is on +z, elevation 90 above.
struct ViewAngle {
  double azimuth = 60, elevation = 20;
};

struct Framing {
  Lens lens;
  double margin = 0.05;  // fraction of the half image left free on each side, [0, 1)
  double distance = 0;   // of the eye from the centre, world units; 0: as near as all views allow
};

// Cameras that look at the centre of the mesh's bounding box, all from one distance. With the
// default distance every used vertex is inside every image. `mesh` must be valid and have a face.
// An error if it has no extent, or for a lens or margin out of range.
Result<std::vector<Camera>> FrameMesh(const Mesh& mesh, const Framing& framing,
                                      std::span<const ViewAngle> views);

}  // namespace tilegrad
