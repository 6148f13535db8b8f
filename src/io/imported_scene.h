// SPDX-License-Identifier: Apache-2.0
// Internal to io: a scene imported by Assimp, as sent by the child process. Plain data, no Assimp
// types.
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
  std::uint32_t material = 0;                 // index into materials; out of range: none
  std::vector<glm::vec3> positions, normals;  // normals, uvs, colors: empty or one per vertex
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec4> colors;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // vertices of this part
};

struct ImportedMaterial {
  std::string name;
  glm::vec4 color{0.8f, 0.8f, 0.8f, 1};
  std::string image;           // name in the file; empty: none
  std::int32_t embedded = -1;  // index into images, or -1 for a separate file
  std::string not_read;        // dropped information about the image
};

struct ImportedImage {
  std::string name;
  Bytes bytes;  // an image file; empty if embedded in an unsupported form
};

// A part placed in the scene.
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

// The importer's questions about other files (MTL, ...): one of these and the name.
inline constexpr char kAskExists = 'E', kAskContent = 'C';

// The only place where Assimp runs (assimp_import.cc). Its importers crash, hang and exhaust memory
// on damaged files, so call this in a child process. It never frees its memory, since the process
// ends next.
Result<ImportedScene> ImportByAssimp(const std::string& name, const Bytes& file, AskParent ask);

// A scene or an error, in the format of this version of the program only.
Bytes EncodeScene(const Result<ImportedScene>& scene);

// Decodes untrusted bytes: checks every count against the bytes left before allocating, and every
// index against its array. Leaves finiteness to Validate (scene/mesh.h). Errors: that of the
// encoded Result, or kDataLoss.
Result<ImportedScene> DecodeScene(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
