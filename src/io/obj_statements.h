// SPDX-License-Identifier: Apache-2.0
// Internal to io: the statements of OBJ files and of their material libraries, as they stand.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::io {

// Vertex, texture coordinate and normal, from 0; -1: none.
using ObjCorner = std::array<std::int32_t, 3>;

struct ObjPolygon {
  std::uint32_t corners = 0;   // how many, three at the least
  std::int32_t material = -1;  // index into `materials`, -1: before the first usemtl
};

struct ObjStatements {
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec4> colors;  // empty, or one a vertex: kNoColor where the file has none
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec3> normals;
  std::vector<ObjCorner> corners;  // of all polygons, one after the other; all in range
  std::vector<ObjPolygon> polygons;
  std::vector<std::string> materials;  // of usemtl, in the order of their first use
  std::vector<std::string> libraries;  // what follows each mtllib
  std::vector<std::string> warnings;
};

// DataLoss names `place` and the line: a number that is not finite, an index without its element.
Result<ObjStatements> ParseObj(std::string_view text, const std::string& place);

// An image on a material: uv * scale + offset says where in it.
struct MtlImage {
  std::string name;  // empty: none
  glm::vec2 scale{1}, offset{0};
  bool clamp = false;
  bool operator==(const MtlImage&) const = default;
};

struct MtlMaterial {
  std::string name;
  glm::vec3 diffuse{1};  // Kd; white where the file has none
  float opacity = 1;     // d, else 1 - Tr
  MtlImage image{};      // map_Kd
  bool operator==(const MtlMaterial&) const = default;
};

struct MtlLibrary {
  std::vector<MtlMaterial> materials;           // in the order of the file
  std::set<std::string, std::less<>> not_read;  // statements and options that change what is drawn
};

// DataLoss names `place` and the line: a number that is not finite.
Result<MtlLibrary> ParseMtl(std::string_view text, const std::string& place);

// The rest of a line as one name, which may contain spaces, without quotes around it.
std::string_view WholeName(std::string_view rest);

// What stands before " #", which begins a comment to some writers and belongs to the name for
// others: for names that are not found whole.
std::string_view WithoutComment(std::string_view name);

}  // namespace tilegrad::io
