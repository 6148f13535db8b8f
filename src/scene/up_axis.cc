// SPDX-License-Identifier: Apache-2.0
#include "scene/up_axis.h"

#include <algorithm>

namespace tilegrad {
namespace {

// turn(row) of each row of the rotation.
template <class Turn>
Camera WithRows(Camera camera, Turn turn) {
  for (float* row : {camera.rotation, camera.rotation + 3, camera.rotation + 6}) {
    const glm::vec3 turned = turn(glm::vec3(row[0], row[1], row[2]));
    std::copy_n(&turned[0], 3, row);
  }
  return camera;
}

}  // namespace

glm::vec3 Upright(UpAxis up, glm::vec3 v) {
  if (up == UpAxis::kZ) return {v.x, v.z, -v.y};
  if (up == UpAxis::kX) return {-v.y, v.x, v.z};
  return v;
}

std::optional<UpAxis> UpAxisNamed(std::string_view name) {
  if (name == "y" || name == "Y") return UpAxis::kY;
  if (name == "z" || name == "Z") return UpAxis::kZ;
  if (name == "x" || name == "X") return UpAxis::kX;
  return std::nullopt;
}

void TurnUpright(UpAxis up, Mesh* mesh) {
  if (up == UpAxis::kY) return;
  for (auto* vectors : {&mesh->positions, &mesh->normals, &mesh->corner_normals})
    for (glm::vec3& v : *vectors) v = Upright(up, v);
}

// The rows of a rotation are directions in the world.
Camera UprightCamera(UpAxis up, Camera camera) {
  return WithRows(camera, [&](glm::vec3 row) { return Upright(up, row); });
}

// A row r of the rotation meets Upright(v) as the row R^T r meets v.
Camera CameraOfFile(UpAxis up, Camera camera) {
  return WithRows(camera, [&](glm::vec3 r) {
    if (up == UpAxis::kZ) return glm::vec3(r.x, -r.z, r.y);
    return up == UpAxis::kX ? glm::vec3(r.y, -r.x, r.z) : r;
  });
}

}  // namespace tilegrad
