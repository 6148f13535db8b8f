// SPDX-License-Identifier: Apache-2.0
// Inputs of a fit whose truth is a formula: a sphere seen by any cameras.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "fit/sphere.h"

namespace tilegrad::train {

struct Ball {
  glm::dvec3 centre{0};
  double radius = 0.5;
};

// Whether the ray through a place on the image meets it, in front.
inline bool Meets(const Ball& ball, const Camera& camera, double x, double y) {
  const float *r = camera.rotation, *t = camera.translation;
  const auto row = [&](int i) { return glm::dvec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]); };
  const glm::dvec3 at(glm::dot(row(0), ball.centre) + static_cast<double>(t[0]),
                      glm::dot(row(1), ball.centre) + static_cast<double>(t[1]),
                      glm::dot(row(2), ball.centre) + static_cast<double>(t[2]));
  const glm::dvec3 along = glm::normalize(
      glm::dvec3((x - static_cast<double>(camera.cx)) / static_cast<double>(camera.fx),
                 -(y - static_cast<double>(camera.cy)) / static_cast<double>(camera.fy), -1));
  return glm::dot(at, along) > 0 && glm::length(glm::cross(at, along)) < ball.radius;
}

// Its masks, grey inside, of images of size x size pixels.
inline FitInput InputOfBall(const Ball& ball, std::span<const Camera> cameras, int size) {
  FitInput input;
  input.images.width = input.images.height = size;
  for (const Camera& camera : cameras) {
    input.names.push_back("view " + std::to_string(input.names.size()));
    input.training.push_back(static_cast<int>(input.cameras.size()));
    input.cameras.push_back(camera);
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        input.images.alpha.push_back(Meets(ball, camera, x + 0.5, y + 0.5) ? 1.0f : 0.0f);
  }
  input.images.color.assign(3 * input.images.alpha.size(), 0.5f);
  input.masked = true;
  return input;
}

}  // namespace tilegrad::train
