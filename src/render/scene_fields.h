// SPDX-License-Identifier: Apache-2.0
// Lists the fields of a scene and of its images once: code that visits all of them uses these lists
// and so covers new fields.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "base/array_checks.h"
#include "tilegrad/renderer.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// Whether light comes from `lights` or `light_directions`, and surfaces have k_a and k_d.
inline bool UsesLights(const ShadingModel& shading) {
  return shading.lighting == Lighting::kLambert || shading.lighting == Lighting::kPhong;
}

// What is interpolated over faces. kUser is the last.
enum class Varying { kColor, kUv, kNormal, kPosition, kLightDirection, kUser };
inline constexpr std::size_t kVaryings = static_cast<std::size_t>(Varying::kUser) + 1;

// An array of a scene with one row per vertex or corner, and its gradient.
template <class T>
struct SceneStream {
  const char* name;
  Varying what;
  int width;  // numbers per row
  Rate rate;
  std::span<const T> values;
  std::span<T> gradient;

  std::size_t rows(const SceneT<T>& scene) const {
    return rate == Rate::kVertex ? scene.positions.size() / 3 : scene.faces.size();
  }
};

// The list of streams: calls visit(name, what, width, field of the scene, field of the gradients),
// with fields by reference. A field is a StreamT, or a span if its rate is fixed.
template <class T, class Scene, class Gradients, class Visit>
constexpr void ForEachStreamField(Scene& s, Gradients& d, const Visit& visit) {
  visit("positions", Varying::kPosition, 3, s.positions, d.positions);
  visit("attributes", Varying::kUser, s.channels, s.attributes, d.attributes);
  visit("colors", Varying::kColor, 3, s.colors, d.colors);
  visit("uvs", Varying::kUv, 2, s.uvs, d.uvs);
  visit("normals", Varying::kNormal, 3, s.normals, d.normals);
  visit("light_directions", Varying::kLightDirection, 3, s.light_directions, d.light_directions);
}

template <class T>
const StreamT<T>& AsStream(const StreamT<T>& stream) {
  return stream;
}

template <class T>
StreamT<T> AsStream(std::span<const T> values) {
  return {values};
}

// Calls visit(SceneStream) for every stream, absent ones included.
template <class T, class Visit>
void ForEachStream(const SceneT<T>& s, const SceneGradientsT<T>& d, const Visit& visit) {
  ForEachStreamField<T>(
      s, d,
      [&](const char* name, Varying what, int width, const auto& field, std::span<T> gradient) {
        const StreamT<T> stream = AsStream<T>(field);
        visit(SceneStream<T>{name, what, width, stream.rate, stream.values, gradient});
      });
}

// The stream interpolated as `what`.
template <class T>
SceneStream<T> StreamOf(const SceneT<T>& scene, Varying what,
                        const SceneGradientsT<T>& gradients = {}) {
  SceneStream<T> out = {};
  ForEachStream(scene, gradients, [&](const SceneStream<T>& stream) {
    if (stream.what == what) out = stream;
  });
  return out;
}

// Calls visit(name, array) for every gradient array except textures', empty ones included;
// gradients may be const.
template <class Gradients, class Visit>
void ForEachPlainArray(Gradients& d, const Visit& visit) {
  using T = typename decltype(d.positions)::element_type;
  SceneT<T> nothing;
  ForEachStreamField<T>(nothing, d, [&](const char* name, Varying, int, auto&, auto& gradient) {
    visit(name, gradient);
  });
  visit("sh", d.sh);
}

// Calls visit(name, numbers of a record...) for the parts of records that have a gradient. Visits
// several records of one kind in parallel, such as a gradient and its increment.
template <class Visit, class... Cameras>
void ForEachCameraPart(const Visit& visit, Cameras&... camera) {
  visit("rotation", std::span(camera.rotation)...);
  visit("translation", std::span(camera.translation)...);
  visit("fx", std::span(&camera.fx, 1)...);
  visit("fy", std::span(&camera.fy, 1)...);
  visit("cx", std::span(&camera.cx, 1)...);
  visit("cy", std::span(&camera.cy, 1)...);
}

template <class Visit, class... Surfaces>
void ForEachSurfacePart(const Visit& visit, Surfaces&... surface) {
  visit("base_color", std::span(surface.base_color)...);
  visit("ambient", std::span(surface.ambient)...);
  visit("diffuse", std::span(surface.diffuse)...);
  visit("specular", std::span(surface.specular)...);
  visit("shininess", std::span(&surface.shininess, 1)...);
}

template <class Visit, class... Lights>
void ForEachLightPart(const Visit& visit, Lights&... light) {
  visit("direction", std::span(light.direction)...);
  visit("intensity", std::span(&light.intensity, 1)...);
}

// For such parts of two records: adds the first to the second.
inline constexpr auto kAddPart = [](const char*, auto from, auto to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
};

// The same; sets *finite to false if a sum is not finite.
inline auto AddPartInto(bool* finite) {
  return [finite](const char*, auto from, auto to) {
    kAddPart("", from, to);
    *finite = *finite && AllFinite(to);
  };
}

// Calls visit(parts of a record as above) for all records of the gradients.
template <class T, class Visit>
void ForEachRecordPart(const SceneGradientsT<T>& d, const Visit& visit) {
  if (d.camera != nullptr) {
    ForEachCameraPart([&](const char* name, auto part) { visit("camera", name, part); }, *d.camera);
  }
  for (SurfaceT<T>& s : d.surfaces) {
    ForEachSurfacePart([&](const char* name, auto part) { visit("surfaces", name, part); }, s);
  }
  for (LightT<T>& l : d.lights) {
    ForEachLightPart([&](const char* name, auto part) { visit("lights", name, part); }, l);
  }
}

// Sets the numbers of all records of the gradients to 0.
template <class T>
void ClearRecords(const SceneGradientsT<T>& d) {
  ForEachRecordPart(d, [](const char*, const char*, std::span<T> part) {
    std::fill(part.begin(), part.end(), T(0));
  });
  if (d.camera != nullptr) d.camera->near_plane = T(0);
}

// Calls visit(name, planes, field of a record...) for the images that have a gradient, in records
// with these members: Outputs, ImagesT, FrameImagesT, FrameGradientsT, structs of C.
template <class Visit, class... Records>
void ForEachImage(int channels, const Visit& visit, Records&... record) {
  visit("color", 3, record.color...);
  visit("alpha", 1, record.alpha...);
  visit("attributes", channels, record.attributes...);
  visit("depth", 1, record.depth...);
  visit("normals", 3, record.normals...);
  visit("uv", 2, record.uv...);
}

// For all images, in records other than gradients.
template <class Visit, class... Records>
void ForEachOutput(int channels, const Visit& visit, Records&... record) {
  ForEachImage(channels, visit, record...);
  visit("barycentrics", 2, record.barycentrics...);
}

}  // namespace tilegrad
