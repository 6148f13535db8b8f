// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "base/array_checks.h"
#include "base/error.h"
#include "render/scene_fields.h"
#include "render/validate.h"
#include "shade/normalize.h"
#include "shade/texture.h"

namespace tilegrad {
namespace {

constexpr float kMostShininess = 1e6f;
constexpr float kMostFocalLength = 1e30f;  // pixels; weights of corners overflow from 1e34 on

template <class Enum>
Status CheckEnumerator(const char* name, Enum value, Enum last) {
  const int number = static_cast<int>(value), end = static_cast<int>(last);
  if (number >= 0 && number <= end) return {};
  return InvalidArgument("{} is {}, must be in 0..{}", name, number, end);
}

Status CheckOptions(const RenderOptions& options) {
  TILEGRAD_TRY(CheckImageSize("width", options.width));
  TILEGRAD_TRY(CheckImageSize("height", options.height));
  if (!(options.delta > 0) || !std::isfinite(options.delta)) {
    return InvalidArgument("options.delta is {}, must be finite and > 0", options.delta);
  }
  if (!(options.max_alpha_error >= 0 && options.max_alpha_error <= 1)) {
    return InvalidArgument("options.max_alpha_error is {}, must be in [0, 1]",
                           options.max_alpha_error);
  }
  TILEGRAD_TRY(CheckEnumerator("options.interpolation", options.interpolation,
                               Interpolation::kScreenLinear));
  TILEGRAD_TRY(CheckEnumerator("options.culling", options.culling, FaceCulling::kBack));
  TILEGRAD_TRY(CheckEnumerator("options.alpha_rule", options.alpha_rule, AlphaRule::kPaper));
  TILEGRAD_TRY(CheckNotNegative("options.paper_box", options.paper_box));
  if (options.paper_faces >= 0) return {};
  return InvalidArgument("options.paper_faces is {}, must be >= 0", options.paper_faces);
}

template <class T>
Status CheckEnumerators(const SceneT<T>& scene) {
  Status status;
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    const int rate = static_cast<int>(stream.rate);
    if (!status.ok() || rate == 0 || rate == 1) return;
    status = InvalidArgument("{}.rate is {}, must be in 0..1", stream.name, rate);
  });
  TILEGRAD_TRY(status);
  TILEGRAD_TRY(
      CheckEnumerator("shading.lighting", scene.shading.lighting, Lighting::kSphericalHarmonics));
  return CheckEnumerator("shading.normals", scene.shading.normals, Normals::kGiven);
}

template <class T>
Status CheckDirections(const SceneT<T>& scene) {
  if (!UsesLights(scene.shading)) return {};
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

template <class T>
Camera CameraInFloat(const CameraT<T>& c) {
  const auto cast = [](T x) { return InFloat(x); };
  Camera out;
  std::transform(std::begin(c.rotation), std::end(c.rotation), out.rotation, cast);
  std::transform(std::begin(c.translation), std::end(c.translation), out.translation, cast);
  out.fx = cast(c.fx);
  out.fy = cast(c.fy);
  out.cx = cast(c.cx);
  out.cy = cast(c.cy);
  out.near_plane = cast(c.near_plane);
  return out;
}

Status CheckCamera(const Camera& camera) {
  TILEGRAD_TRY(CheckFinite("camera.rotation", camera.rotation));
  TILEGRAD_TRY(CheckFinite("camera.translation", camera.translation));
  using Number = std::pair<const char*, float>;
  for (const auto& [name, value] : {Number("fx", camera.fx), Number("fy", camera.fy)}) {
    if (value != 0 && std::abs(value) <= kMostFocalLength) continue;
    return InvalidArgument("camera.{} is {}, must be in -{}..{} and not 0", name, value,
                           kMostFocalLength, kMostFocalLength);
  }
  if (!(camera.near_plane > 0) || !std::isfinite(camera.near_plane)) {
    return InvalidArgument("camera.near_plane is {}, must be finite and > 0", camera.near_plane);
  }
  for (const auto& [name, value] : {Number("cx", camera.cx), Number("cy", camera.cy)}) {
    if (std::isfinite(value)) continue;
    return InvalidArgument("camera.{} is {}, must be finite", name, value);
  }
  return {};
}

Status CheckFaces(std::span<const std::int32_t> faces, std::size_t vertices) {
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] < 0 || static_cast<std::size_t>(faces[i]) >= vertices) {
      return InvalidArgument("faces[{}] is {}, outside of [0, {})", i, faces[i], vertices);
    }
  }
  return {};
}

// Limits arrays so that indices, times the few numbers per row, do not overflow.
template <class T>
Status CheckMeshSizes(const SceneT<T>& scene) {
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max() / 8;
  const std::size_t positions = scene.positions.size(), faces = scene.faces.size();
  const std::size_t attributes = scene.attributes.values.size();
  if (positions % 3 != 0) {
    return InvalidArgument("positions must be [V,3], got {} numbers", positions);
  }
  if (faces % 3 != 0) return InvalidArgument("faces must be [F,3], got {} indices", faces);
  if (std::max({positions, faces, attributes}) > kMost) {
    return ResourceExhausted(
        "{} numbers of positions, {} of faces, {} of attributes: the limit is {} each", positions,
        faces, attributes, kMost);
  }
  if (scene.channels < 0) return InvalidArgument("channels is {}, must be >= 0", scene.channels);
  if (static_cast<std::size_t>(scene.channels) <= kMost) return {};
  return ResourceExhausted("{} channels: the limit is {}", scene.channels, kMost);
}

// Many views of one mesh share its arrays: skips those checked for the previous scene.
template <class T>
Status CheckMesh(const SceneT<T>& scene, const SceneT<T>& known) {
  TILEGRAD_TRY(CheckMeshSizes(scene));
  const std::size_t vertices = scene.positions.size() / 3;
  const bool known_faces =
      SameArray(scene.faces, known.faces) && scene.positions.size() == known.positions.size();
  if (!known_faces && !AllWithin(scene.faces, 0, static_cast<std::int32_t>(vertices))) {
    return CheckFaces(scene.faces, vertices);
  }
  if (SameArray(scene.positions, known.positions)) return {};
  return CheckNumbers("positions", scene.positions);
}

// As long as no number exceeds this, no colour overflows float: it is a product of at most five
// (base colour, texture, vertex colour, coefficient, intensity), summed over the lights.
constexpr float kMostSafe = 0x1p20f;

// CheckNumbers; sets *large if some number exceeds that.
template <class T>
Status CheckValues(const char* array, std::span<const T> values, bool* large) {
  if (AllBelow(values, T(kMostSafe))) return {};
  *large = true;
  return CheckNumbers(array, values);
}

// Also checks streams that shading does not use: a number that is not finite is a mistake anywhere.
template <class T>
Status CheckStreams(const SceneT<T>& scene, const SceneT<T>& known, bool* large) {
  Status status;
  ForEachStream(scene, {}, [&](const SceneStream<T>& s) {
    if (!status.ok() || s.what == Varying::kPosition) return;
    if (s.values.empty() && s.what != Varying::kUser) return;  // `channels` asks for attributes
    status = CheckShape(s.name, s.values.size(), s.rows(scene), static_cast<std::size_t>(s.width));
    if (!status.ok() || SameArray(s.values, StreamOf(known, s.what).values)) return;
    status = CheckValues(s.name, s.values, large);
  });
  TILEGRAD_TRY(status);
  if (scene.shading.normals != Normals::kGiven || !scene.normals.values.empty()) return {};
  if (StreamOf(scene, Varying::kNormal).rows(scene) == 0) return {};
  return InvalidArgument("shading.normals is kGiven, but the scene has no normals");
}

Status CheckTextureSide(const char* name, int texels) {
  if (texels >= 1 && texels <= shade::kMaxTextureSize) return {};
  return InvalidArgument("{} is {}, must be in 1..{} texels", name, texels, shade::kMaxTextureSize);
}

template <class T>
Status CheckTexture(const TextureT<T>& texture, std::span<const T> known, bool* large) {
  TILEGRAD_TRY(CheckEnumerator("wrap", texture.wrap, Wrap::kMirrorClamp));
  TILEGRAD_TRY(CheckEnumerator("filter", texture.filter, Filter::kTrilinear));
  TILEGRAD_TRY(CheckTextureSide("width", texture.width));
  TILEGRAD_TRY(CheckTextureSide("height", texture.height));
  TILEGRAD_TRY(CheckSize(
      "texels", texture.texels.size(),
      3 * static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height)));
  if (SameArray(texture.texels, known)) return {};
  return CheckValues("texels", texture.texels, large);
}

template <class T>
Status CheckTextures(const SceneT<T>& scene, const SceneT<T>& known, bool* large) {
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    const auto texels = i < known.textures.size() ? known.textures[i].texels : std::span<const T>();
    const Status status = CheckTexture(scene.textures[i], texels, large);
    if (!status.ok()) return status.Within(fmt::format("textures[{}]", i));
  }
  if (!scene.textures.empty() && scene.uvs.values.empty()) {
    return InvalidArgument("the scene has textures, but no uvs to look them up by");
  }
  return {};
}

template <class T>
Status CheckSurface(const SurfaceT<T>& surface, std::size_t textures, bool* large) {
  if (surface.texture < -1 || surface.texture >= static_cast<int>(textures)) {
    return InvalidArgument("texture is {}, outside of [-1, {})", surface.texture, textures);
  }
  if (!(surface.shininess >= 0 && surface.shininess <= T(kMostShininess))) {
    return InvalidArgument("shininess is {}, must be in [0, {}]", InFloat(surface.shininess),
                           kMostShininess);
  }
  Status status;
  ForEachSurfacePart(
      [&](const char* name, std::span<const T> part) {
        if (status.ok()) status = CheckValues(name, part, large);
      },
      surface);
  return status;
}

template <class T>
Status CheckSurfaces(const SceneT<T>& scene, bool* large) {
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    TILEGRAD_TRY(CheckSurface(scene.surfaces[i], scene.textures.size(), large)
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

template <class T>
Status CheckLight(const LightT<T>& light, bool* large) {
  TILEGRAD_TRY(CheckValues<T>("direction", light.direction, large));
  return CheckValues("intensity", std::span(&light.intensity, 1), large);
}

template <class T>
Status CheckLights(const SceneT<T>& scene, bool* large) {
  const bool harmonics = scene.shading.lighting == Lighting::kSphericalHarmonics;
  if (harmonics || !scene.sh.empty()) TILEGRAD_TRY(CheckSize("sh", scene.sh.size(), 9));
  TILEGRAD_TRY(CheckValues("sh", scene.sh, large));
  if (UsesLights(scene.shading) && scene.lights.empty() == scene.light_directions.empty()) {
    return InvalidArgument("lighting needs either lights or light_directions; the scene has {}",
                           scene.lights.empty() ? "neither" : "both");
  }
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const Status status = CheckLight(scene.lights[i], large);
    if (!status.ok()) return status.Within(fmt::format("lights[{}]", i));
  }
  return CheckDirections(scene);
}

// `known`: the previous scene, or an empty one.
template <class T>
Status CheckScene(const SceneT<T>& scene, const SceneT<T>& known, bool* large) {
  TILEGRAD_TRY(CheckEnumerators(scene));
  TILEGRAD_TRY(CheckMesh(scene, known));
  TILEGRAD_TRY(CheckCamera(CameraInFloat(scene.camera)));
  TILEGRAD_TRY(CheckStreams(scene, known, large));
  TILEGRAD_TRY(CheckTextures(scene, known, large));
  TILEGRAD_TRY(CheckSurfaces(scene, large));
  return CheckLights(scene, large);
}

template <class T>
SceneParts PartsOf(const SceneT<T>& s) {
  SceneParts out;
  out.shading = s.shading;
  ForEachStream(s, {}, [&](const SceneStream<T>& stream) {
    const auto v = static_cast<std::size_t>(stream.what);
    out.has[v] = !stream.values.empty();
    out.rates[v] = stream.rate;
  });
  out.textures = !s.textures.empty();
  out.surfaces = !s.surfaces.empty();
  out.user_channels = s.channels;
  for (const TextureT<T>& texture : s.textures) {
    out.bilinear |= texture.filter != Filter::kNearest;
    out.trilinear |= texture.filter == Filter::kTrilinear;
  }
  return out;
}

// `scene`: the scene of `b`, for the names of its streams.
template <class T>
Status CheckAgreement(const SceneParts& a, const SceneParts& b, const SceneT<T>& scene) {
  const char* what = nullptr;
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    const auto v = static_cast<std::size_t>(stream.what);
    const bool counts = stream.what != Varying::kPosition && stream.what != Varying::kUser;
    if (what == nullptr && ((counts && a.has[v] != b.has[v]) || a.rates[v] != b.rates[v])) {
      what = stream.name;
    }
  });
  if (a.user_channels != b.user_channels) what = "attributes";
  if (a.textures != b.textures) what = "textures";
  if (a.surfaces != b.surfaces) what = "surfaces";
  if (!(a.shading == b.shading)) what = "options of the shading model";
  if (what == nullptr) return {};
  return InvalidArgument("{} differ from those of scene 0: a batch must agree", what);
}

}  // namespace

template <class T>
Result<SceneParts> ValidateScenes(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                                  const Workers& workers) {
  TILEGRAD_TRY(CheckOptions(options));
  const SceneT<T> nothing;
  const auto check = [&](std::size_t n, bool* large) {
    return CheckScene(scenes[n], n > 0 ? scenes[n - 1] : nothing, large);
  };
  std::atomic<bool> sound = true, any_large = false;
  workers.For(scenes.size(), [&](std::size_t n, std::size_t) {
    bool large = false;
    if (!check(n, &large).ok()) sound = false;
    if (large) any_large = true;
  });
  SceneParts parts;
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    bool large = false;
    Status status = sound ? Status() : check(n, &large);
    const SceneParts own = PartsOf(scenes[n]);
    if (n == 0) parts = own;
    if (status.ok()) status = CheckAgreement(parts, own, scenes[n]);
    if (!status.ok()) return status.Within(SceneName(n));
    parts.bilinear |= own.bilinear;
    parts.trilinear |= own.trilinear;
  }
  parts.may_overflow = any_large;
  return parts;
}

template Result<SceneParts> ValidateScenes(std::span<const Scene>, const RenderOptions&,
                                           const Workers&);
template Result<SceneParts> ValidateScenes(std::span<const SceneT<double>>, const RenderOptions&,
                                           const Workers&);

}  // namespace tilegrad
