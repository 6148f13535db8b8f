// SPDX-License-Identifier: Apache-2.0
// Meshes whose up is not +y: programs for building and printing have z up, some have x. The mesh is
// turned so that this axis is +y, as glTF has it: (x, y, z) becomes (x, z, -y) for z, so that what
// faces -y, the front in such programs, faces +z, where default cameras stand; (-y, x, z) for x.
#pragma once

#include <optional>
#include <string_view>

#include "scene/camera.h"
#include "scene/mesh.h"

namespace tilegrad {

enum class UpAxis { kY, kZ, kX };

// "y", "z", "x", in upper case, too; nothing for other words.
std::optional<UpAxis> UpAxisNamed(std::string_view name);

// A place or a direction; exact, as all of these.
glm::vec3 Upright(UpAxis up, glm::vec3 v);

// Positions and normals.
void TurnUpright(UpAxis up, Mesh* mesh);

// The camera that sees of a mesh turned upright what `camera` sees of the one as its file has it.
Camera UprightCamera(UpAxis up, Camera camera);

// And back: the camera that sees of a mesh as its file has it what `camera` sees of the one turned
// upright.
Camera CameraOfFile(UpAxis up, Camera camera);

}  // namespace tilegrad
