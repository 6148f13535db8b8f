// SPDX-License-Identifier: Apache-2.0
// The scene of most checks: a bumpy sphere with colours, a texture, two materials and light.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "proof/owned_scene.h"

namespace tilegrad::selftest {

struct SphereShape {
  Lighting lighting = Lighting::kPhong;
  Normals normals = Normals::kSmooth;
  Filter filter = Filter::kBilinear;
  float near_plane = 0.01f;     // the sphere starts at a depth of 2.2
  int level = 2;                // of the icosphere: 20 * 4^level faces
  int width = 32, height = 32;  // pixels of the camera's image
  std::uint64_t seed = 1;
};

// The same bits on every machine, since it uses sums, products and square roots only.
OwnedScene<float> MakeSphere(const SphereShape& shape);

// Covers every lighting model, normals derived from positions, and filters with a gradient; one
// sphere is cut open, so that its inside is visible, too.
struct NamedSphere {
  const char* name;
  SphereShape shape;
};
inline constexpr NamedSphere kSpheres[] = {
    {"no light", {.lighting = Lighting::kNone}},
    {"Lambert, cut open", {.lighting = Lighting::kLambert, .near_plane = 2.6f}},
    {"Phong", {.lighting = Lighting::kPhong}},
    {"harmonics, flat, trilinear",
     {.lighting = Lighting::kSphericalHarmonics,
      .normals = Normals::kFlat,
      .filter = Filter::kTrilinear}}};

Outputs ImagesWithGradients();  // color, alpha, depth, normals, uv

RenderOptions SphereOptions(const SphereShape& shape);

// The numbers of a scene or its gradient, by field.
template <class T>
std::map<std::string, std::vector<T>> NumbersOf(OwnedScene<T>& scene) {
  std::map<std::string, std::vector<T>> out;
  ForEachNumber(scene, [&](const char* name, T& number) { out[name].push_back(number); });
  return out;
}

}  // namespace tilegrad::selftest
