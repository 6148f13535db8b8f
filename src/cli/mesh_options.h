// SPDX-License-Identifier: Apache-2.0
// What a mesh file does not say and the user must: which axis is up, which image is its texture.
#pragma once

#include <string>

#include "cli/command.h"
#include "io/mesh_file.h"
#include "scene/mesh.h"

namespace tilegrad::cli {

// --up with y, z or x.
void AddUpOption(Command* command, UpAxis* up);
void AddTextureOption(Command* command, std::string* file);

// Puts the image on all materials without a texture, in place of their colour; does nothing if
// `file` is empty. Errors: no such material, no texture coordinates, an image that cannot be read.
Status TakeTexture(const std::string& file, io::LoadedMesh* mesh);

}  // namespace tilegrad::cli
