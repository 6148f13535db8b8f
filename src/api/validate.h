// SPDX-License-Identifier: Apache-2.0
// What the engine takes for granted and a caller may still get wrong: numbers that are no
// enumerator, from C at least, and lights without a direction.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "shade/normalize.h"
#include "tilegrad/renderer.h"

namespace tilegrad::v0 {

template <class Enum>
Status CheckEnumerator(const char* name, Enum value, Enum last) {
  const int number = static_cast<int>(value), end = static_cast<int>(last);
  if (number >= 0 && number <= end) return {};
  return InvalidArgument("{} is {}, must be in 0..{}", name, number, end);
}

inline Status ValidateEnumerations(const RenderOptions& options) {
  TILEGRAD_TRY(CheckEnumerator("options.interpolation", options.interpolation,
                               Interpolation::kScreenLinear));
  TILEGRAD_TRY(CheckEnumerator("options.culling", options.culling, FaceCulling::kBack));
  return CheckEnumerator("options.alpha_rule", options.alpha_rule, AlphaRule::kPaper);
}

template <class T>
Status ValidateEnumerations(const SceneT<T>& scene) {
  TILEGRAD_TRY(CheckEnumerator("colors.rate", scene.colors.rate, Rate::kCorner));
  TILEGRAD_TRY(CheckEnumerator("uvs.rate", scene.uvs.rate, Rate::kCorner));
  TILEGRAD_TRY(CheckEnumerator("normals.rate", scene.normals.rate, Rate::kCorner));
  TILEGRAD_TRY(CheckEnumerator("attributes.rate", scene.attributes.rate, Rate::kCorner));
  TILEGRAD_TRY(
      CheckEnumerator("shading.lighting", scene.shading.lighting, Lighting::kSphericalHarmonics));
  TILEGRAD_TRY(CheckEnumerator("shading.normals", scene.shading.normals, Normals::kGiven));
  for (const TextureT<T>& texture : scene.textures) {
    TILEGRAD_TRY(CheckEnumerator("texture.wrap", texture.wrap, Wrap::kMirror));
    TILEGRAD_TRY(CheckEnumerator("texture.filter", texture.filter, Filter::kTrilinear));
  }
  return {};
}

// To the engine it is darkness, and it pulls nothing: an optimiser would stay there.
template <class T>
Status ValidateLights(const SceneT<T>& scene) {
  const Lighting lighting = scene.shading.lighting;
  if (lighting != Lighting::kLambert && lighting != Lighting::kPhong) return {};
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const auto& d = scene.lights[i].direction;
    if (std::all_of(d.begin(), d.end(),
                    [](T x) { return std::abs(x) <= shade::kLeastComponent; })) {
      return InvalidArgument("lights[{}]: direction is {} {} {}, must not be 0", i, d[0], d[1],
                             d[2]);
    }
  }
  return {};
}

}  // namespace tilegrad::v0
