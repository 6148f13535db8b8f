// SPDX-License-Identifier: Apache-2.0
// Internal to io: what an Assimp importer found in a file, as sent by the process that ran it.
// Plain data, no Assimp type.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "io/guarded_process.h"

namespace tilegrad::io {

struct ImportedPart {
  std::string name;
  std::uint32_t material = 0;                 // in materials; beyond them: none
  std::vector<glm::vec3> positions, normals;  // normals, uvs, colors: empty or one
  std::vector<glm::vec2> uvs;                 // a vertex
  std::vector<glm::vec4> colors;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // vertices of this part
};

struct ImportedMaterial {
  std::string name;
  glm::vec4 color{0.8f, 0.8f, 0.8f, 1};
  std::string image;           // as the file names it; empty: none
  std::int32_t embedded = -1;  // in images, or -1 if the image is a file of its own
  std::string not_read;        // what the file says about the image and is left out
};

struct ImportedImage {
  std::string name;
  Bytes bytes;  // an image file; empty if it is embedded in a form that is not read
};

// A part at a place of the scene.
struct ImportedInstance {
  std::uint32_t part = 0;
  glm::dmat4x3 to_scene{1};
};

struct ImportedScene {
  std::vector<ImportedPart> parts;
  std::vector<ImportedMaterial> materials;
  std::vector<ImportedImage> images;
  std::vector<ImportedInstance> instances;
  std::vector<std::string> warnings;
};

// Questions that an importer has about other files (MTL, ...): one of these and the name.
inline constexpr char kAskExists = 'E', kAskContent = 'C';

// The only place where Assimp runs (assimp_import.cc). Its importers crash, hang and take memory
// without end on damaged files, so this is called in a process of its own. It never frees what it
// made: the process ends next.
Result<ImportedScene> ImportByAssimp(const std::string& name, const Bytes& file, AskParent ask);

// A scene, or why there is none, as bytes of one version of this program.
Bytes EncodeScene(const Result<ImportedScene>& scene);

// Decodes untrusted bytes: every count is checked against what is left before anything is
// allocated, every index against what it points into. Whether numbers are finite is left to
// Validate (scene/mesh.h). Errors: that of the encoded Result, or kDataLoss.
Result<ImportedScene> DecodeScene(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
