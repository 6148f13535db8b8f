// SPDX-License-Identifier: Apache-2.0
// Internal to io: the statements of an OBJ file, as they stand.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
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

}  // namespace tilegrad::io
