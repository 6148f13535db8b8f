// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

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
  glm::vec4 base_color = {0.8f, 0.8f, 0.8f, 1.0f};  // multiplies the texture; alpha < 1 is glass
  int base_color_texture = -1;                      // index into Mesh::textures, -1 for none
  std::array<TextureWrap, 2> wrap = {TextureWrap::kRepeat, TextureWrap::kRepeat};  // along u, v
  bool nearest = false;                       // texels as squares, not filtered
  AlphaMode alpha_mode = AlphaMode::kOpaque;  // as requested by the file
  float alpha_cutoff = 0.5f;                  // of kMask: what has less alpha is not there
  bool double_sided = true;                   // false: viewers do not draw its back faces
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
  std::vector<glm::vec4> corner_colors;  // [0, 1]; instead of `colors`, of which there is none then

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
// Over vertices that faces use. The mesh must be valid and have a face.
Bounds MeshBounds(const Mesh& mesh);

// Moves the centre of the bounding box to the origin and scales so that the largest half-extent is
// `half_extent` (datasets: 0.45). An error for an empty mesh or one without extent.
Status NormalizeToBox(Mesh& mesh, float half_extent);

// Leaves the faces whose entry of `keep` (one for each face) is not 0, with what their corners
// have. Vertices, materials and textures stay. Returns false and changes nothing if none is to be
// kept.
bool KeepFaces(const std::vector<char>& keep, Mesh* mesh);

// The colours hold their light already, as those that were learned from images do: materials become
// unlit, so that no viewer shades them again. A mesh without materials gets a white one, `name`.
void SetUnlit(Mesh& mesh, const std::string& name);

}  // namespace tilegrad
