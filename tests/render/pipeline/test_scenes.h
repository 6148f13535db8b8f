// SPDX-License-Identifier: Apache-2.0
// Scenes for the tests of raster and render.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/rng.h"
#include "proof/owned_scene.h"

namespace tilegrad::test {

template <class T>
using TestScene = OwnedMesh<T>;

inline void RandomAttributes(int channels, Rate rate, Rng* rng, TestScene<float>* scene) {
  scene->channels = channels;
  scene->rate = rate;
  const std::size_t rows = rate == Rate::kVertex ? scene->vertex_count() : scene->faces.size();
  scene->attributes.resize(rows * static_cast<std::size_t>(channels));
  for (float& a : scene->attributes) a = static_cast<float>(rng->Uniform());
}

// `faces` independent triangles of about `size` in a unit cube around the origin, seen from 2.5
// away.
inline TestScene<float> TriangleSoup(std::size_t faces, double size, int width, int height,
                                     Rng* rng) {
  TestScene<float> scene;
  scene.camera = OrbitCamera({45.0, width, height}, rng->Uniform(0, 360), 20, 2.5);
  for (std::size_t f = 0; f < faces; ++f) {
    double centre[3];
    for (double& c : centre) c = rng->Uniform(-0.7, 0.7);
    for (int k = 0; k < 3; ++k) {
      for (const double c : centre) {
        scene.positions.push_back(static_cast<float>(c + rng->Uniform(-size, size)));
      }
      scene.faces.push_back(static_cast<std::int32_t>(3 * f) + k);
    }
  }
  RandomAttributes(3, Rate::kVertex, rng, &scene);
  return scene;
}

// A bumpy closed sphere of rings x segments quads, so that edges and vertices are shared.
inline TestScene<float> BumpySphere(int rings, int segments, int width, int height, Rng* rng) {
  TestScene<float> scene;
  scene.camera = OrbitCamera({45.0, width, height}, rng->Uniform(0, 360), 25, 2.2);
  for (int r = 0; r <= rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const double polar = 3.141592653589793 * (r + 0.01) / (rings + 0.02);
      const double around = 6.283185307179586 * s / segments;
      const double radius = 0.6 + rng->Uniform(-0.05, 0.05);
      scene.positions.push_back(static_cast<float>(radius * std::sin(polar) * std::cos(around)));
      scene.positions.push_back(static_cast<float>(radius * std::cos(polar)));
      scene.positions.push_back(static_cast<float>(-radius * std::sin(polar) * std::sin(around)));
    }
  }
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const int a = r * segments + s, b = r * segments + (s + 1) % segments;
      const int c = a + segments, d = b + segments;
      for (const int v : {a, c, b, b, c, d}) scene.faces.push_back(v);
    }
  }
  RandomAttributes(3, Rate::kVertex, rng, &scene);
  return scene;
}

// A soup with the camera inside of it, so that many faces cross the near plane.
inline TestScene<float> SoupAroundCamera(std::size_t faces, int width, int height, Rng* rng) {
  TestScene<float> scene = TriangleSoup(faces, 1.0, width, height, rng);
  const float eye[3] = {0.05f, 0.1f, 0.2f}, target[3] = {0.3f, 0, -1}, up[3] = {0, 1, 0};
  scene.camera = LookAtCamera({70.0, width, height}, eye, target, up);
  scene.camera.near_plane = 0.1f;
  return scene;
}

}  // namespace tilegrad::test
