// SPDX-License-Identifier: Apache-2.0
#include "render/shading/validate.h"

#include <cmath>
#include <cstddef>
#include <string>

#include "base/error.h"
#include "render/pipeline/quick_checks.h"
#include "render/pipeline/validate.h"

namespace tilegrad {
namespace {

constexpr float kMostShininess = 1e6f;

Status CheckSize(const char* array, std::size_t got, std::size_t expected) {
  if (got == expected) return {};
  return InvalidArgument("{} has {} numbers, expected {}", array, got, expected);
}

// Many views of one mesh share its arrays: what was checked for the scene before is not looked
// through again.
template <class T>
bool SameArray(std::span<T> a, std::span<T> b) {
  return a.data() == b.data() && a.size() == b.size();
}

Status CheckStreamShape(const char* array, const AttributeStreamT<float>& stream, std::size_t width,
                        const ShadedScene& scene) {
  if (stream.values.empty()) return {};
  const std::size_t rows =
      stream.rate == AttributeRate::kVertex ? scene.positions.size() / 3 : scene.faces.size();
  return CheckShape(array, stream.values.size(), rows, width);
}

Status CheckStream(const char* array, const AttributeStreamT<float>& stream, std::size_t width,
                   const ShadedScene& scene, const AttributeStreamT<float>& known) {
  if (stream.values.empty()) return {};
  TILEGRAD_TRY(CheckStreamShape(array, stream, width, scene));
  return SameArray(stream.values, known.values) ? Status() : CheckFinite(array, stream.values);
}

Status CheckTexture(const shade::TextureView& texture, std::span<const float> known) {
  const auto in_range = [](int n) { return n >= 1 && n <= shade::kMaxTextureSize; };
  if (!in_range(texture.width) || !in_range(texture.height)) {
    return InvalidArgument("is {} x {} texels; each side must be in 1..{}", texture.width,
                           texture.height, shade::kMaxTextureSize);
  }
  if (texture.channels != 3) {
    return InvalidArgument("has {} channels, must have 3", texture.channels);
  }
  TILEGRAD_TRY(CheckSize(
      "texels", texture.texels.size(),
      3 * static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height)));
  return SameArray(texture.texels, known) ? Status() : CheckFinite("texels", texture.texels);
}

Status CheckTextures(const ShadedScene& scene, const ShadedScene& known) {
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    const auto texels =
        i < known.textures.size() ? known.textures[i].texels : std::span<const float>();
    const Status status = CheckTexture(scene.textures[i], texels);
    if (!status.ok()) return status.Within(fmt::format("textures[{}]", i));
  }
  if (!scene.textures.empty() && scene.uvs.values.empty()) {
    return InvalidArgument("the scene has textures, but no uvs to look them up by");
  }
  return {};
}

Status CheckSurface(const Surface& surface, std::size_t textures) {
  if (surface.texture < -1 || surface.texture >= static_cast<int>(textures)) {
    return InvalidArgument("texture is {}, but the scene has {}", surface.texture, textures);
  }
  TILEGRAD_TRY(CheckFinite("base_color", surface.base_color));
  TILEGRAD_TRY(CheckFinite("ambient", surface.ambient));
  TILEGRAD_TRY(CheckFinite("diffuse", surface.diffuse));
  TILEGRAD_TRY(CheckFinite("specular", surface.specular));
  if (surface.shininess >= 0 && surface.shininess <= kMostShininess) return {};
  return InvalidArgument("shininess is {}, must be in [0, {}]", surface.shininess, kMostShininess);
}

Status CheckSurfaces(const ShadedScene& scene) {
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    TILEGRAD_TRY(CheckSurface(scene.surfaces[i], scene.textures.size())
                     .Within(fmt::format("surfaces[{}]", i)));
  }
  if (scene.face_surfaces.empty()) return {};
  TILEGRAD_TRY(CheckSize("face_surfaces", scene.face_surfaces.size(), scene.faces.size() / 3));
  const std::size_t count = scene.surfaces.empty() ? 1 : scene.surfaces.size();
  for (std::size_t i = 0; i < scene.face_surfaces.size(); ++i) {
    const std::int32_t s = scene.face_surfaces[i];
    if (s >= 0 && static_cast<std::size_t>(s) < count) continue;
    return InvalidArgument("face_surfaces[{}] is {}, outside of [0, {})", i, s, count);
  }
  return {};
}

Status CheckLights(const ShadedScene& scene, const ShadedScene& known) {
  if (scene.model.lighting == Lighting::kSphericalHarmonics) {
    TILEGRAD_TRY(CheckSize("sh", scene.sh.size(), 9));
    return CheckFinite("sh", scene.sh);
  }
  if (scene.model.lighting == Lighting::kNone) return {};
  if (scene.lights.empty() == scene.light_directions.empty()) {
    return InvalidArgument("lighting needs either lights or light_directions; the scene has {}",
                           scene.lights.empty() ? "neither" : "both");
  }
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const auto& light = scene.lights[i];
    const float numbers[4] = {light.direction[0], light.direction[1], light.direction[2],
                              light.intensity};
    const Status status = CheckFinite("direction, intensity", numbers);
    if (!status.ok()) return status.Within(fmt::format("lights[{}]", i));
  }
  return CheckStream("light_directions", {scene.light_directions, AttributeRate::kVertex}, 3, scene,
                     {known.light_directions, AttributeRate::kVertex});
}

Status CheckMesh(const ShadedScene& scene, const ShadedScene& known) {
  const SceneView& view = scene;
  TILEGRAD_TRY(ValidateSceneSizes(view));
  if (SameArray(scene.positions, known.positions) && SameArray(scene.faces, known.faces)) return {};
  if (AllWithin(scene.faces, 0, static_cast<std::int32_t>(scene.positions.size() / 3)) &&
      AllFinite(scene.positions)) {
    return {};
  }
  return ValidateSceneNumbers(view);
}

// What shading does not use may hold any numbers, but gradients of it have its shape.
Status CheckUnusedShapes(const ShadedScene& scene) {
  TILEGRAD_TRY(CheckStreamShape("normals", scene.normals, 3, scene));
  TILEGRAD_TRY(CheckStreamShape("light_directions",
                                {scene.light_directions, AttributeRate::kVertex}, 3, scene));
  return scene.sh.empty() ? Status() : CheckSize("sh", scene.sh.size(), 9);
}

// `known`: the scene before, or an empty one.
Status CheckScene(const ShadedScene& scene, const ShadedScene& known) {
  TILEGRAD_TRY(CheckMesh(scene, known));
  if (!SameArray(scene.attributes, known.attributes)) {
    TILEGRAD_TRY(CheckFinite("attributes", scene.attributes));
  }
  TILEGRAD_TRY(CheckUnusedShapes(scene));
  TILEGRAD_TRY(CheckStream("colors", scene.colors, 3, scene, known.colors));
  TILEGRAD_TRY(CheckStream("uvs", scene.uvs, 2, scene, known.uvs));
  if (scene.model.normals == NormalKind::kGiven) {
    const bool corners = scene.normals.rate == AttributeRate::kCorner;
    if (scene.normals.values.empty() &&
        !(corners ? scene.faces.empty() : scene.positions.empty())) {
      return InvalidArgument("model.normals is kGiven, but the scene has no normals");
    }
    TILEGRAD_TRY(CheckStream("normals", scene.normals, 3, scene, known.normals));
  }
  TILEGRAD_TRY(CheckTextures(scene, known));
  TILEGRAD_TRY(CheckSurfaces(scene));
  return CheckLights(scene, known);
}

bool SameModel(const ShadingModel& a, const ShadingModel& b) {
  return a.lighting == b.lighting && a.normals == b.normals && a.two_sided == b.two_sided &&
         a.clamp == b.clamp && a.sh_basis == b.sh_basis;
}

SceneParts PartsOf(const ShadedScene& s) {
  SceneParts out;
  out.model = s.model;
  out.colors = !s.colors.values.empty(), out.colors_rate = s.colors.rate;
  out.uvs = !s.uvs.values.empty(), out.uvs_rate = s.uvs.rate;
  out.normals = !s.normals.values.empty(), out.normals_rate = s.normals.rate;
  out.textures = !s.textures.empty(), out.surfaces = !s.surfaces.empty();
  out.light_directions = !s.light_directions.empty();
  out.user_channels = s.channels, out.user_rate = s.rate;
  return out;
}

Status CheckAgreement(const SceneParts& a, const SceneParts& b) {
  const auto differs = [](const char* what) {
    return InvalidArgument("{} differ from those of scene 0: a batch must agree", what);
  };
  if (!SameModel(a.model, b.model)) return differs("options of the shading model");
  if (a.colors != b.colors || a.colors_rate != b.colors_rate) return differs("colors");
  if (a.uvs != b.uvs || a.uvs_rate != b.uvs_rate) return differs("uvs");
  if (a.normals != b.normals || a.normals_rate != b.normals_rate) return differs("normals");
  if (a.textures != b.textures) return differs("textures");
  if (a.surfaces != b.surfaces) return differs("surfaces");
  if (a.light_directions != b.light_directions) return differs("light_directions");
  if (a.user_channels != b.user_channels || a.user_rate != b.user_rate) {
    return differs("attributes");
  }
  return {};
}

std::string SceneName(std::size_t n) { return fmt::format("scene {}", n); }

Status CheckWanted(const char* array, std::size_t got, std::size_t expected) {
  return got == 0 ? Status() : CheckSize(array, got, expected);
}

Status CheckGradients(const ShadedScene& scene, const ShadedGradients& d) {
  TILEGRAD_TRY(CheckWanted("d_scene.positions", d.positions.size(), scene.positions.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.attributes", d.attributes.size(), scene.attributes.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.colors", d.colors.size(), scene.colors.values.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.uvs", d.uvs.size(), scene.uvs.values.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.normals", d.normals.size(), scene.normals.values.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.light_directions", d.light_directions.size(),
                           scene.light_directions.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.surfaces", d.surfaces.size(),
                           scene.surfaces.empty() ? 1 : scene.surfaces.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.lights", d.lights.size(), scene.lights.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.sh", d.sh.size(), scene.sh.size()));
  TILEGRAD_TRY(CheckWanted("d_scene.textures", d.textures.size(), scene.textures.size()));
  for (std::size_t i = 0; i < d.textures.size(); ++i) {
    TILEGRAD_TRY(
        CheckWanted("d_scene.textures[i]", d.textures[i].size(), scene.textures[i].texels.size()));
  }
  return {};
}

Status CheckGradientNumbers(const ShadedGradients& d, const ShadedGradients& known) {
  TILEGRAD_TRY(CheckFinite("d_scene.colors", d.colors));
  TILEGRAD_TRY(CheckFinite("d_scene.uvs", d.uvs));
  TILEGRAD_TRY(CheckFinite("d_scene.normals", d.normals));
  TILEGRAD_TRY(CheckFinite("d_scene.light_directions", d.light_directions));
  TILEGRAD_TRY(CheckFinite("d_scene.sh", d.sh));
  for (std::size_t i = 0; i < d.textures.size(); ++i) {
    if (i < known.textures.size() && SameArray(d.textures[i], known.textures[i])) continue;
    TILEGRAD_TRY(CheckFinite("d_scene.textures", d.textures[i]));
  }
  for (const Surface& s : d.surfaces) {
    TILEGRAD_TRY(CheckFinite("d_scene.surfaces.base_color", s.base_color));
    TILEGRAD_TRY(CheckFinite("d_scene.surfaces.ambient", s.ambient));
    TILEGRAD_TRY(CheckFinite("d_scene.surfaces.diffuse", s.diffuse));
    TILEGRAD_TRY(CheckFinite("d_scene.surfaces.specular", s.specular));
    TILEGRAD_TRY(CheckFinite("d_scene.surfaces.shininess", {&s.shininess, 1}));
  }
  for (const auto& light : d.lights) {
    TILEGRAD_TRY(CheckFinite("d_scene.lights.direction", light.direction));
    TILEGRAD_TRY(CheckFinite("d_scene.lights.intensity", {&light.intensity, 1}));
  }
  return {};
}

}  // namespace

Result<SceneParts> ValidateShadedScenes(std::span<const ShadedScene> scenes) {
  SceneParts parts;
  const ShadedScene nothing;
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    const Status sound = CheckScene(scenes[n], n > 0 ? scenes[n - 1] : nothing);
    if (!sound.ok()) return sound.Within(SceneName(n));
    const SceneParts own = PartsOf(scenes[n]);
    if (n == 0) parts = own;
    if (const Status status = CheckAgreement(parts, own); !status.ok()) {
      return status.Within(SceneName(n));
    }
    for (const shade::TextureView& texture : scenes[n].textures) {
      parts.bilinear |= texture.filter != shade::Filter::kNearest;
      parts.trilinear |= texture.filter == shade::Filter::kTrilinear;
    }
  }
  return parts;
}

Status ValidateShadedBackward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                              const ShadedFrameGradients& d_frame,
                              std::span<const ShadedGradients> d_scenes) {
  if (d_scenes.size() != scenes.size()) {
    return InvalidArgument("{} scenes, but {} d_scenes", scenes.size(), d_scenes.size());
  }
  const std::size_t pixels = scenes.size() * static_cast<std::size_t>(options.width) *
                             static_cast<std::size_t>(options.height);
  const auto channels = scenes.empty() ? 0 : static_cast<std::size_t>(scenes[0].channels);
  TILEGRAD_TRY(CheckWanted("d_frame.color", d_frame.color.size(), 3 * pixels));
  TILEGRAD_TRY(CheckWanted("d_frame.normals", d_frame.normals.size(), 3 * pixels));
  TILEGRAD_TRY(CheckWanted("d_frame.uv", d_frame.uv.size(), 2 * pixels));
  TILEGRAD_TRY(CheckWanted("d_frame.depth", d_frame.depth.size(), pixels));
  TILEGRAD_TRY(CheckWanted("d_frame.attributes", d_frame.attributes.size(), channels * pixels));
  if (!d_frame.depth.empty() && options.interpolation != Interpolation::kPerspective) {
    return InvalidArgument("d_frame.depth needs options.interpolation kPerspective");
  }
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (const Status status = CheckGradients(scenes[n], d_scenes[n]); !status.ok()) {
      return status.Within(SceneName(n));
    }
  }
  return {};
}

Status ValidateShadedCotangents(const ShadedFrameGradients& d_frame,
                                std::span<const std::int32_t> face_ids) {
  TILEGRAD_TRY(CheckFinite("d_frame.color", d_frame.color));
  TILEGRAD_TRY(CheckFinite("d_frame.normals", d_frame.normals));
  TILEGRAD_TRY(CheckFinite("d_frame.uv", d_frame.uv));
  for (std::size_t i = 0; i < d_frame.depth.size(); ++i) {
    const bool background = i < face_ids.size() && face_ids[i] < 0;
    if (background || std::isfinite(d_frame.depth[i])) continue;
    return InvalidArgument("d_frame.depth[{}] is {}", i, d_frame.depth[i]);
  }
  return CheckFinite("d_frame.attributes", d_frame.attributes);
}

Status ValidateShadedResult(std::span<const ShadedGradients> d_scenes) {
  const ShadedGradients nothing;
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    const ShadedGradients& d = d_scenes[n];
    const SceneGradients& geometry = d;
    TILEGRAD_TRY(ValidateResult(geometry).Within(SceneName(n)));
    if (const Status status = CheckGradientNumbers(d, n > 0 ? d_scenes[n - 1] : nothing);
        !status.ok()) {
      return status.Within(SceneName(n) + ": the gradient overflows");
    }
  }
  return {};
}

}  // namespace tilegrad
