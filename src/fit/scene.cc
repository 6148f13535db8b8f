// SPDX-License-Identifier: Apache-2.0
#include "fit/scene.h"

#include <algorithm>

#include "base/error.h"
#include "fit/unknowns.h"

namespace tilegrad::train {

const char* NameOf(Parameter parameter) {
  static constexpr std::array kNames = {"positions", "colors", "texture",  "uv",       "camera",
                                        "light",     "sh",     "material", "exposure", "focal"};
  return kNames[static_cast<std::size_t>(parameter)];
}

bool ParameterSet::empty() const {
  return std::none_of(has.begin(), has.end(), [](bool b) { return b; });
}

std::string WhyExcluded(const FitScene& scene, Parameter parameter) {
  const bool textured = !scene.texture.empty();
  switch (parameter) {
    case Parameter::kColors:
      return scene.colors.empty() ? "the scene has no vertex colours" : "";
    case Parameter::kTexture:
      return textured ? "" : "the scene has no texture";
    case Parameter::kUv:
      if (!textured) return "the scene has no texture to look up";
      return scene.filter == Filter::kNearest
                 ? "the nearest filter has no gradient to texture coordinates: choose the bilinear "
                   "or trilinear filter"
                 : "";
    case Parameter::kLight:
      return scene.uses_lights() ? "" : "only Lambert and Phong light have a direction";
    case Parameter::kSh:
      return scene.shading.lighting == Lighting::kSphericalHarmonics
                 ? ""
                 : "the lighting is not spherical harmonics";
    case Parameter::kMaterial:
      return scene.uses_lights() ? "" : "only Lambert and Phong light read a material";
    case Parameter::kExposure:
      return scene.gains.size() > 1 ? "" : "exposures need more than one image";
    default:
      return "";
  }
}

Status FitRenderer::Render(const FitScene& scene, const Job& job) {
  const nn::NoGrad off(context_);
  Unknowns(context_, scene, {}).Render(&renderer_, job);
  return context_.TakeStatus();
}

}  // namespace tilegrad::train
