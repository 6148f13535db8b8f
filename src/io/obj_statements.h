// SPDX-License-Identifier: Apache-2.0
// Internal to io: parses the statements of OBJ files and their material libraries, without
// interpretation.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::io {

// Indices of vertex, texture coordinate and normal, from 0; -1: none.
using ObjCorner = std::array<std::int32_t, 3>;

struct ObjPolygon {
  std::uint32_t corners = 0;   // three or more
  std::int32_t material = -1;  // index into `materials`, -1: before the first usemtl
};

struct ObjStatements {
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec4> colors;  // empty, or one per vertex: kNoColor if the file has none
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec3> normals;
  std::vector<ObjCorner> corners;  // of all polygons, concatenated; all in range
  std::vector<ObjPolygon> polygons;
  std::vector<std::string> materials;  // of usemtl, in order of first use
  std::vector<std::string> libraries;  // the argument of each mtllib
  std::vector<std::string> warnings;
};

// DataLoss names `place` and the line: a number that is not finite, an index out of range.
Result<ObjStatements> ParseObj(std::string_view text, const std::string& place);

// A material's image, sampled at uv * scale + offset.
struct MtlImage {
  std::string name;  // empty: none
  glm::vec2 scale{1}, offset{0};
  bool clamp = false;
  bool operator==(const MtlImage&) const = default;
};

struct MtlMaterial {
  std::string name;
  glm::vec3 diffuse{1};  // Kd; white if the file has none
  float opacity = 1;     // d, else 1 - Tr
  MtlImage image{};      // map_Kd
  bool operator==(const MtlMaterial&) const = default;
};

struct MtlLibrary {
  std::vector<MtlMaterial> materials;           // in file order
  std::set<std::string, std::less<>> not_read;  // ignored, though they would change the picture
};

// DataLoss names `place` and the line: a number that is not finite.
Result<MtlLibrary> ParseMtl(std::string_view text, const std::string& place);

// The rest of a line as one name, possibly with spaces, without surrounding quotes.
std::string_view WholeName(std::string_view rest);

// The name up to " #", which starts a comment in some writers' files but belongs to the name in
// others': for names that were not found whole.
std::string_view WithoutComment(std::string_view name);

}  // namespace tilegrad::io
