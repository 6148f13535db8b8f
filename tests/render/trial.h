// SPDX-License-Identifier: Apache-2.0
// Random scenes with everything that shading knows, their visibility and cotangents.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "proof/owned_scene.h"
#include "render/pipeline/test_scenes.h"
#include "render/reference.h"

namespace tilegrad::test {

// What a random scene is made of.
struct SceneRecipe {
  const char* name;
  Lighting lighting = Lighting::kNone;
  bool colors = true, textured = false, per_vertex_light = false;
};

inline void RandomVectors(std::size_t rows, double low, double high, std::size_t width, Rng* rng,
                          std::vector<float>* out) {
  out->resize(rows * width);
  for (float& v : *out) v = static_cast<float>(rng->Uniform(low, high));
}

inline std::array<float, 3> RandomTriple(double low, double high, Rng* rng) {
  std::array<float, 3> out;
  for (float& v : out) v = static_cast<float>(rng->Uniform(low, high));
  return out;
}

inline void AddTextures(Rng* rng, OwnedScene<float>* s) {
  s->uvs_rate = rng->Below(2) == 0 ? Rate::kCorner : Rate::kVertex;
  const std::size_t rows =
      s->uvs_rate == Rate::kCorner ? s->mesh.faces.size() : s->mesh.vertex_count();
  RandomVectors(rows, -0.7, 1.7, 2, rng, &s->uvs);
  for (int k = 0; k < 2; ++k) {
    OwnedTexture<float> t;
    t.width = 1 + static_cast<int>(rng->Below(6));
    t.height = 1 + static_cast<int>(rng->Below(6));
    t.wrap = static_cast<Wrap>(rng->Below(9));
    t.filter = static_cast<Filter>(rng->Below(3));
    RandomVectors(static_cast<std::size_t>(t.width * t.height), 0, 1, 3, rng, &t.texels);
    s->textures.push_back(std::move(t));
  }
}

inline void AddSurfaces(Rng* rng, OwnedScene<float>* s) {
  for (int k = 0; k < 3; ++k) {
    const int texture = s->textures.empty() ? -1 : k - 1;
    s->surfaces.push_back({RandomTriple(0.3, 1, rng), texture, RandomTriple(0, 0.3, rng),
                           RandomTriple(0.3, 1, rng), RandomTriple(0.1, 0.6, rng),
                           static_cast<float>(rng->Uniform(1, 12))});
  }
  for (std::size_t f = 0; f < s->mesh.face_count(); ++f) {
    s->face_surfaces.push_back(static_cast<std::int32_t>(rng->Below(3)));
  }
}

inline void AddLights(const SceneRecipe& recipe, Rng* rng, OwnedScene<float>* s) {
  s->shading.lighting = recipe.lighting;
  s->shading.normals = static_cast<Normals>(rng->Below(3));
  s->shading.two_sided = rng->Below(2) == 0;
  if (s->shading.normals == Normals::kGiven) {
    RandomVectors(s->mesh.vertex_count(), -1, 1, 3, rng, &s->normals);
  }
  if (recipe.lighting == Lighting::kSphericalHarmonics) {
    RandomVectors(9, -0.5, 1, 1, rng, &s->sh);
  } else if (recipe.per_vertex_light) {
    RandomVectors(s->mesh.vertex_count(), 0.1, 1, 3, rng, &s->light_directions);
  } else if (recipe.lighting != Lighting::kNone) {
    for (int k = 0; k < 2; ++k) {
      s->lights.push_back({RandomTriple(-2, 2, rng), static_cast<float>(rng->Uniform(0.3, 1))});
    }
  }
}

// A sphere with bumps, or a soup; from outside, or (seldom) cut by the near plane.
inline OwnedScene<float> RandomScene(const SceneRecipe& recipe, int width, int height, Rng* rng) {
  OwnedScene<float> s;
  switch (rng->Below(5)) {
    case 0:
      s.mesh = SoupAroundCamera(6, width, height, rng);
      break;
    case 1:
    case 2:
      s.mesh = TriangleSoup(5, 0.7, width, height, rng);
      break;
    default:
      s.mesh = BumpySphere(3, 5, width, height, rng);
  }
  RandomAttributes(2, rng->Below(2) == 0 ? Rate::kVertex : Rate::kCorner, rng, &s.mesh);
  if (recipe.colors) RandomVectors(s.mesh.vertex_count(), 0, 1, 3, rng, &s.colors);
  if (recipe.textured) AddTextures(rng, &s);
  AddSurfaces(rng, &s);
  AddLights(recipe, rng, &s);
  s.shading.clamp = rng->Below(4) == 0;
  return s;
}

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
