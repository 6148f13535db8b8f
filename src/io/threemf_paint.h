// SPDX-License-Identifier: Apache-2.0
// Internal to io: what Assimp's 3MF importer does not tell of a file.
#pragma once

#include <string_view>

namespace tilegrad::io {

// Whether triangles of one object of a 3MF model are painted differently, or colour groups are
// used: Assimp 5.2 gives an object the material of its last triangle, and does not read the groups.
bool HasPaintedTriangles(std::string_view model_xml);

}  // namespace tilegrad::io
