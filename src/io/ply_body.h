// SPDX-License-Identifier: Apache-2.0
// Internal to io: what follows the header of a PLY file.
#pragma once

#include <string>
#include <vector>

#include "io/mesh_file.h"
#include "io/ply_header.h"

namespace tilegrad::io {

// Vertices, faces and strips of triangles as a mesh, without its materials. Returns the number of
// each triangle's texture, as the file has it, or nothing if faces have none.
Result<std::vector<double>> ReadPlyBody(const PlyHeader& header, const std::string& place,
                                        LoadedMesh& out);

}  // namespace tilegrad::io
