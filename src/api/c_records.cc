// SPDX-License-Identifier: Apache-2.0
#include "api/c_records.h"

#include <array>
#include <cstdint>
#include <limits>

#include "render/scene_fields.h"

namespace tilegrad::api {
namespace {

template <class T>
std::span<T> SpanOf(T* data, std::size_t count) {
  return data == nullptr ? std::span<T>() : std::span<T>(data, count);
}

// 0 for a texture with invalid sides; Render's error names the sides.
std::size_t TexelsOf(const tilegrad_texture& t) {
  if (t.width < 0 || t.height < 0) return 0;
  return 3 * static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height);
}

std::size_t SurfacesOf(const Scene& scene) {
  return std::max<std::size_t>(scene.surfaces.size(), 1);
}

// For parts of two records with the same members.
constexpr auto kCopy = [](const char*, std::span<const float> from, std::span<float> to) {
  std::copy(from.begin(), from.end(), to.begin());
};

template <class To, class From>
To CopyCamera(const From& from) {
  To to = {};
  ForEachCameraPart(kCopy, from, to);
  to.near_plane = from.near_plane;
  return to;
}

Surface SurfaceOf(const tilegrad_surface& from) {
  Surface to;
  ForEachSurfacePart(kCopy, from, to);
  to.texture = from.texture;
  return to;
}

Light LightOf(const tilegrad_light& from) {
  Light to;
  ForEachLightPart(kCopy, from, to);
  return to;
}

struct RowCounts {
  std::size_t vertices, corners;
};

void Set(const float* from, std::size_t width, RowCounts rows, std::span<const float>* to) {
  *to = SpanOf(from, rows.vertices * width);
}

void Set(const tilegrad_stream& from, std::size_t width, RowCounts rows, Stream* to) {
  const bool corner = from.per_corner != 0;
  to->values = SpanOf(from.values, (corner ? rows.corners : rows.vertices) * width);
  to->rate = corner ? Rate::kCorner : Rate::kVertex;
}

// Of as many rows as there are vertices or corners.
void SetStreams(const tilegrad_scene& from, Scene* to) {
  const RowCounts rows{from.vertices, 3 * from.face_count};
  ForEachStreamField<float>(
      *to, from, [&](const char*, Varying, int width, auto& field, const auto& values) {
        Set(values, static_cast<std::size_t>(std::max(width, 0)), rows, &field);
      });
}

// NULL for an empty list, whatever its data pointer.
template <class Item>
const Item* ItemsOf(std::span<const Item> list) {
  return list.empty() ? nullptr : list.data();
}

const float* DataOf(std::span<const float> image) { return image.empty() ? nullptr : image.data(); }

}  // namespace

Status CheckStructSize(const char* name, std::size_t size) {
  constexpr std::size_t kMost = 65536;
  if (size >= sizeof(std::size_t) && size <= kMost) return {};
  return InvalidArgument("{}.struct_size is {}: call tilegrad_..._init first", name, size);
}

Status CheckCount(const char* name, std::size_t count) {
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
  if (count <= kMost) return {};
  return InvalidArgument("{} is {}, must be in 0..{}", name, count, kMost);
}

Status CheckCounts(const tilegrad_scene& scene) {
  const struct {
    const char* array;
    bool given;
    const char* name;
    std::size_t count;
  } all[] = {{"positions", scene.positions != nullptr, "vertices", scene.vertices},
             {"faces", scene.faces != nullptr, "face_count", scene.face_count},
             {"textures", scene.textures != nullptr, "texture_count", scene.texture_count},
             {"surfaces", scene.surfaces != nullptr, "surface_count", scene.surface_count},
             {"lights", scene.lights != nullptr, "light_count", scene.light_count}};
  for (const auto& a : all) {
    TILEGRAD_TRY(CheckCount(a.name, a.count));
    if (a.given || a.count == 0) continue;
    return InvalidArgument("{} is NULL, but {} is {}", a.array, a.name, a.count);
  }
  if (scene.attributes.values == nullptr || scene.channels != 0 || scene.vertices == 0) return {};
  return InvalidArgument("attributes is given, but channels is 0");
}

Status CheckRequested(const tilegrad_scene_gradients& wanted, const Scene& scene) {
  const char* missing = nullptr;
  const auto check = [&](const char* name, const void* array, const void* given) {
    if (missing == nullptr && array != nullptr && given == nullptr) missing = name;
  };
  ForEachStreamField<float>(
      scene, wanted,
      [&](const char* name, Varying what, int, const auto& field, const float* gradient) {
        if (what != Varying::kPosition) check(name, gradient, AsStream<float>(field).values.data());
      });
  check("sh", wanted.sh, scene.sh.data());
  check("textures", wanted.textures, ItemsOf(scene.textures));
  check("lights", wanted.lights, ItemsOf(scene.lights));
  if (missing == nullptr) return {};
  return InvalidArgument("d_scene.{} is requested, but the scene has none", missing);
}

void CScene::Set(const tilegrad_scene& from) {
  textures.clear();
  surfaces.clear();
  lights.clear();
  for (const tilegrad_texture& t : SpanOf(from.textures, from.texture_count)) {
    textures.push_back({SpanOf(t.texels, TexelsOf(t)), t.width, t.height, static_cast<Wrap>(t.wrap),
                        static_cast<Filter>(t.filter)});
  }
  for (const tilegrad_surface& s : SpanOf(from.surfaces, from.surface_count)) {
    surfaces.push_back(SurfaceOf(s));
  }
  for (const tilegrad_light& l : SpanOf(from.lights, from.light_count)) {
    lights.push_back(LightOf(l));
  }
  scene.faces = SpanOf(from.faces, 3 * from.face_count);
  scene.channels = from.channels;
  SetStreams(from, &scene);
  scene.camera = CopyCamera<Camera>(from.camera);
  scene.textures = textures;
  scene.surfaces = surfaces;
  scene.lights = lights;
  scene.face_surfaces = SpanOf(from.face_surfaces, from.face_count);
  scene.shading = {static_cast<Lighting>(from.lighting), static_cast<Normals>(from.normal_kind),
                   from.two_sided != 0, from.clamp != 0};
  scene.sh = SpanOf(from.sh, 9);
}

namespace {

void SetArrays(const tilegrad_scene_gradients& from, const Scene& scene, SceneGradients* to) {
  std::array<float*, kVaryings> arrays = {};
  ForEachStreamField<float>(scene, from,
                            [&](const char*, Varying what, int, const auto&, float* gradient) {
                              arrays[static_cast<std::size_t>(what)] = gradient;
                            });
  ForEachStreamField<float>(
      scene, *to,
      [&](const char*, Varying what, int, const auto& field, std::span<float>& gradient) {
        gradient =
            SpanOf(arrays[static_cast<std::size_t>(what)], AsStream<float>(field).values.size());
      });
}

}  // namespace

void CGradients::Set(const tilegrad_scene_gradients& from, const Scene& scene) {
  textures.clear();
  for (std::size_t i = 0; from.textures != nullptr && i < scene.textures.size(); ++i) {
    textures.push_back(SpanOf(from.textures[i], scene.textures[i].texels.size()));
  }
  surfaces.resize(from.surfaces == nullptr ? 0 : SurfacesOf(scene));
  lights.resize(from.lights == nullptr ? 0 : scene.lights.size());
  gradients.camera = from.camera == nullptr ? nullptr : &camera;
  gradients.textures = textures;
  gradients.surfaces = surfaces;
  gradients.lights = lights;
  gradients.sh = SpanOf(from.sh, scene.sh.size());
  SetArrays(from, scene, &gradients);
  ClearRecords(gradients);
}

void CGradients::Clear(const tilegrad_scene_gradients& to, const Scene& scene) {
  if (to.camera != nullptr) *to.camera = {};
  for (tilegrad_light& light : SpanOf(to.lights, scene.lights.size())) light = {};
  for (tilegrad_surface& s : SpanOf(to.surfaces, SurfacesOf(scene))) {
    const int32_t texture = s.texture;
    s = {};
    s.texture = texture;
  }
}

bool CGradients::AddTo(const tilegrad_scene_gradients& to) const {
  bool finite = true;
  const auto add = AddPartInto(&finite);
  if (to.camera != nullptr) ForEachCameraPart(add, camera, *to.camera);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    ForEachSurfacePart(add, surfaces[i], to.surfaces[i]);
  }
  for (std::size_t i = 0; i < lights.size(); ++i) {
    ForEachLightPart(add, lights[i], to.lights[i]);
  }
  return finite;
}

RenderOptions OptionsOf(const tilegrad_options& from) {
  return {.width = from.width,
          .height = from.height,
          .delta = from.delta,
          .max_alpha_error = from.max_alpha_error,
          .interpolation = static_cast<Interpolation>(from.interpolation),
          .culling = static_cast<FaceCulling>(from.culling),
          .alpha_rule = static_cast<AlphaRule>(from.alpha_rule),
          .paper_box = from.paper_box,
          .paper_faces = from.paper_faces};
}

Outputs OutputsOf(const tilegrad_options& from) {
  Outputs to;
  ForEachOutput(
      0, [](const char*, int, std::int32_t wanted, bool& out) { out = wanted != 0; }, from, to);
  return to;
}

tilegrad_camera CameraOf(const Camera& from) { return CopyCamera<tilegrad_camera>(from); }

FrameGradients FrameGradientsOf(const tilegrad_frame_gradients& from, const Images& images) {
  FrameGradients to;
  ForEachImage(
      images.channels,
      [&](const char*, int planes, const float* image, std::span<const float>& out) {
        out = SpanOf(image, static_cast<std::size_t>(planes) * images.face_ids.size());
      },
      from, to);
  return to;
}

tilegrad_images ImagesOf(const Images& from) {
  tilegrad_images to = {};
  to.count = from.count;
  to.height = from.height;
  to.width = from.width;
  to.channels = from.channels;
  to.face_ids = from.face_ids.empty() ? nullptr : from.face_ids.data();
  ForEachOutput(
      from.channels,
      [](const char*, int, std::span<const float> image, const float*& out) {
        out = DataOf(image);
      },
      from, to);
  to.alpha_error_bound = from.alpha_error_bound;
  return to;
}

}  // namespace tilegrad::api
