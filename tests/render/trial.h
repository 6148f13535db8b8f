// SPDX-License-Identifier: Apache-2.0
// A random scene with its visibility and cotangents, for tests of the Renderer.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "render/random_scenes.h"
#include "render/reference.h"

namespace tilegrad::test {

inline const SceneRecipe kRecipes[] = {
    {"color"},
    {"texture", Lighting::kNone, false, true},
    {"texture_and_color", Lighting::kNone, true, true},
    {"lambert", Lighting::kLambert},
    {"lambert_textured", Lighting::kLambert, false, true},
    {"lambert_vertex_light", Lighting::kLambert, true, false, true},
    {"phong", Lighting::kPhong},
    {"phong_textured", Lighting::kPhong, true, true},
    {"phong_vertex_light", Lighting::kPhong, true, false, true},
    {"harmonics", Lighting::kSphericalHarmonics},
    {"harmonics_textured", Lighting::kSphericalHarmonics, true, true},
};

inline constexpr int kTrialWidth = 13, kTrialHeight = 11;
inline constexpr std::size_t kTrialPixels = kTrialWidth * kTrialHeight;

inline RenderOptions TrialOptions() {
  RenderOptions options;
  options.width = kTrialWidth;
  options.height = kTrialHeight;
  options.delta = 1e-2;
  options.max_alpha_error = 1e-7;
  return options;
}

inline Outputs EveryImage() {
  Outputs request;
  request.depth = request.normals = request.uv = true;
  return request;
}

// One in four interpolates on the screen, where depth has no gradient.
struct Trial {
  OwnedScene<float> scene;
  RenderOptions options = TrialOptions();
  Outputs images = EveryImage();
  std::vector<std::int32_t> ids;
  OwnedCotangents<double> d_frame;
  bool seen = false;

  Trial(const SceneRecipe& recipe, std::uint64_t seed) {
    Rng rng(seed, 77);
    scene = RandomScene(recipe, kTrialWidth, kTrialHeight, &rng);
    ids = FaceIdsRef(scene.mesh.View(), TrialOptions());
    d_frame = OwnedCotangents<double>(kTrialPixels, 2, &rng);
    if (seed % 4 == 0) {
      options.interpolation = Interpolation::kScreenLinear;
      images.depth = false;
      d_frame.depth.clear();
    }
    if (scene.uvs.empty()) std::fill(d_frame.uv.begin(), d_frame.uv.end(), 0.0);
    for (const std::int32_t id : ids) seen |= id >= 0;
  }
};

// The kinds of parameters that have a gradient in a recipe's scenes.
inline std::vector<std::string> KindsOf(const SceneRecipe& recipe) {
  std::vector<std::string> kinds = {"positions",   "attributes", "rotation",
                                    "translation", "lens",       "base_color"};
  if (recipe.colors) kinds.push_back("colors");
  if (recipe.textured) kinds.insert(kinds.end(), {"uvs", "texture"});
  const bool lights = UsesLights({.lighting = recipe.lighting});
  if (lights) kinds.insert(kinds.end(), {"ambient", "diffuse"});
  if (lights && !recipe.per_vertex_light) kinds.insert(kinds.end(), {"light", "intensity"});
  if (recipe.per_vertex_light) kinds.push_back("light_directions");
  if (recipe.lighting == Lighting::kPhong) kinds.insert(kinds.end(), {"specular", "shininess"});
  if (recipe.lighting == Lighting::kSphericalHarmonics) kinds.push_back("sh");
  return kinds;
}

}  // namespace tilegrad::test
