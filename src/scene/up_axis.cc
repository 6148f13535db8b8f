// SPDX-License-Identifier: Apache-2.0
#include "scene/up_axis.h"

#include <algorithm>

namespace tilegrad {

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
  for (int i = 0; i < 3; ++i) {
    float* r = camera.rotation + 3 * i;
    const glm::vec3 turned = Upright(up, {r[0], r[1], r[2]});
    for (int k = 0; k < 3; ++k) r[k] = turned[k];
  }
  return camera;
}

// A row r of the rotation meets Upright(v) as the row R^T r meets v.
Camera CameraOfFile(UpAxis up, Camera camera) {
  for (int i = 0; i < 3; ++i) {
    float* r = camera.rotation + 3 * i;
    const float x = r[0], y = r[1], z = r[2];
    if (up == UpAxis::kZ) {
      r[0] = x;
      r[1] = -z;
      r[2] = y;
    }
    if (up == UpAxis::kX) {
      r[0] = y;
      r[1] = -x;
      r[2] = z;
    }
  }
  return camera;
}

}  // namespace tilegrad
