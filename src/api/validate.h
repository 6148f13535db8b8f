// SPDX-License-Identifier: Apache-2.0
// What the engine takes for granted and a caller may still get wrong, from C at least: numbers that
// are no enumerator.
#pragma once

#include "base/error.h"
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

}  // namespace tilegrad::v0
