// SPDX-License-Identifier: Apache-2.0
#include "fit/input_up.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "base/error.h"
#include "fit/masks/floor.h"

namespace tilegrad::train {
namespace {

// How cameras stand about an axis of the world: means of the axis along their x and y axes.
struct Stand {
  double tilt = 0, upright = 0;
};

Stand StandAbout(std::span<const Camera> cameras, int axis) {
  Stand out;
  for (const Camera& camera : cameras) {
    out.tilt += std::abs(static_cast<double>(camera.rotation[axis]));
    out.upright += static_cast<double>(camera.rotation[3 + axis]);
  }
  out.tilt /= static_cast<double>(cameras.size());
  out.upright /= static_cast<double>(cameras.size());
  return out;
}

// Turns the world so that `up`, of length 1, becomes y.
void TurnLevel(glm::vec3 up, std::span<Camera> cameras) {
  const glm::vec3 any = std::abs(up.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  const glm::vec3 z = glm::normalize(glm::cross(any, up)), x = glm::cross(up, z);
  for (Camera& camera : cameras) {
    for (int row = 0; row < 9; row += 3) {
      float* const r = camera.rotation + row;
      const glm::vec3 old(r[0], r[1], r[2]);
      r[0] = glm::dot(x, old);
      r[1] = glm::dot(up, old);
      r[2] = glm::dot(z, old);
    }
  }
}

}  // namespace

std::optional<UpAxis> GuessUp(std::span<const Camera> cameras) {
  constexpr double kLevel = 0.1, kRolled = 0.25, kUpright = 0.2;
  constexpr std::size_t kLeastCameras = 4;
  if (cameras.size() < kLeastCameras || StandAbout(cameras, 1).tilt < kRolled) return std::nullopt;
  for (const auto& [axis, up] : {std::pair(2, UpAxis::kZ), std::pair(0, UpAxis::kX)}) {
    const Stand stand = StandAbout(cameras, axis);
    if (stand.tilt < kLevel && stand.upright > kUpright) return up;
  }
  return std::nullopt;
}

void TurnInputUpright(std::optional<UpAxis> up, FitInput* input) {
  if (!up && input->own_world) return TurnLevel(UpOf(input->cameras), input->cameras);
  if (!up) {
    up = GuessUp(input->cameras);
    if (up) {
      input->warnings.push_back(
          fmt::format("all cameras are upright if {0} points up, so the mesh is turned from {0} up "
                      "to y up; --up y leaves it as it is",
                      *up == UpAxis::kZ ? "z" : "x"));
    }
  }
  input->up = up.value_or(UpAxis::kY);
  for (Camera& camera : input->cameras) camera = UprightCamera(input->up, camera);
}

}  // namespace tilegrad::train
