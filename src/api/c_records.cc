// SPDX-License-Identifier: Apache-2.0
#include "api/c_records.h"

#include <cstdint>
#include <limits>

#include "api/convert.h"

namespace tilegrad::v0 {
namespace {

template <class T>
std::span<T> SpanOf(T* data, std::size_t count) {
  return data == nullptr ? std::span<T>() : std::span<T>(data, count);
}

// Of a texture whose sides are wrong there are no texels; Render names the sides.
std::size_t TexelsOf(const tilegrad_texture& t) {
  if (t.width < 0 || t.height < 0) return 0;
  return 3 * static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height);
}

std::size_t SurfacesOf(const Scene& scene) {
  return std::max<std::size_t>(scene.surfaces.size(), 1);
}

Camera CameraOf(const tilegrad_camera& from) {
  Camera to;
  std::copy_n(from.rotation, 9, to.rotation), std::copy_n(from.translation, 3, to.translation);
  to.fx = from.fx, to.fy = from.fy, to.cx = from.cx, to.cy = from.cy;
  to.near_plane = from.near_plane;
  return to;
}

Surface SurfaceOf(const tilegrad_surface& from) {
  Surface to;
  std::copy_n(from.base_color, 3, to.base_color.begin());
  std::copy_n(from.ambient, 3, to.ambient.begin());
  std::copy_n(from.diffuse, 3, to.diffuse.begin());
  std::copy_n(from.specular, 3, to.specular.begin());
  to.shininess = from.shininess, to.texture = from.texture;
  return to;
}

void Add(std::span<const float> from, float* to) {
  for (std::size_t i = 0; i < from.size(); ++i) to[i] += from[i];
}

void AddSurface(const Surface& from, tilegrad_surface* to) {
  Add(from.base_color, to->base_color), Add(from.ambient, to->ambient);
  Add(from.diffuse, to->diffuse), Add(from.specular, to->specular);
  to->shininess += from.shininess;
}

void AddCamera(const Camera& from, tilegrad_camera* to) {
  Add(from.rotation, to->rotation), Add(from.translation, to->translation);
  to->fx += from.fx, to->fy += from.fy, to->cx += from.cx, to->cy += from.cy;
}

// NULL of an empty list, whatever memory it has.
template <class Item>
const Item* ItemsOf(std::span<const Item> list) {
  return list.empty() ? nullptr : list.data();
}

const float* DataOf(std::span<const float> image) { return image.empty() ? nullptr : image.data(); }

}  // namespace

Status CheckStructSize(const char* name, std::size_t size) {
  constexpr std::size_t kMost = 65536;
  if (size >= sizeof(std::size_t) && size <= kMost) return {};
  return InvalidArgument("{}.struct_size is {}: tilegrad_..._init comes first", name, size);
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
  return {};
}

Status CheckWanted(const tilegrad_scene_gradients& wanted, const Scene& scene) {
  const struct {
    const char* array;
    const void *wanted, *given;
  } all[] = {{"colors", wanted.colors, scene.colors.values.data()},
             {"uvs", wanted.uvs, scene.uvs.values.data()},
             {"normals", wanted.normals, scene.normals.values.data()},
             {"attributes", wanted.attributes, scene.attributes.values.data()},
             {"light_directions", wanted.light_directions, scene.light_directions.data()},
             {"sh", wanted.sh, scene.sh.data()},
             {"textures", wanted.textures, ItemsOf(scene.textures)},
             {"lights", wanted.lights, ItemsOf(scene.lights)}};
  for (const auto& a : all) {
    if (a.wanted == nullptr || a.given != nullptr) continue;
    return InvalidArgument("d_scene.{} is wanted, but the scene has none", a.array);
  }
  return {};
}

void CScene::Set(const tilegrad_scene& from) {
  const std::size_t vertices = from.vertices, corners = 3 * from.face_count;
  const auto channels = static_cast<std::size_t>(std::max(from.channels, 0));
  const auto stream = [&](const tilegrad_stream& s, std::size_t width) {
    const bool corner = s.per_corner != 0;
    return Stream{SpanOf(s.values, (corner ? corners : vertices) * width),
                  corner ? Rate::kCorner : Rate::kVertex};
  };
  textures.clear(), surfaces.clear(), lights.clear();
  for (const tilegrad_texture& t : SpanOf(from.textures, from.texture_count)) {
    textures.push_back({SpanOf(t.texels, TexelsOf(t)), t.width, t.height, static_cast<Wrap>(t.wrap),
                        static_cast<Filter>(t.filter)});
  }
  for (const tilegrad_surface& s : SpanOf(from.surfaces, from.surface_count)) {
    surfaces.push_back(SurfaceOf(s));
  }
  for (const tilegrad_light& l : SpanOf(from.lights, from.light_count)) {
    lights.push_back({{l.direction[0], l.direction[1], l.direction[2]}, l.intensity});
  }
  scene.positions = SpanOf(from.positions, 3 * vertices);
  scene.faces = SpanOf(from.faces, corners);
  scene.camera = CameraOf(from.camera);
  scene.colors = stream(from.colors, 3), scene.uvs = stream(from.uvs, 2);
  scene.normals = stream(from.normals, 3), scene.attributes = stream(from.attributes, channels);
  scene.channels = from.channels;
  scene.textures = textures, scene.surfaces = surfaces, scene.lights = lights;
  scene.face_surfaces = SpanOf(from.face_surfaces, from.face_count);
  scene.shading = {static_cast<Lighting>(from.lighting), static_cast<Normals>(from.normal_kind),
                   from.two_sided != 0, from.clamp != 0};
  scene.light_directions = SpanOf(from.light_directions, 3 * vertices);
  scene.sh = SpanOf(from.sh, 9);
}

void CGradients::Set(const tilegrad_scene_gradients& from, const Scene& scene) {
  textures.clear();
  for (std::size_t i = 0; from.textures != nullptr && i < scene.textures.size(); ++i) {
    textures.push_back(SpanOf(from.textures[i], scene.textures[i].texels.size()));
  }
  surfaces.resize(from.surfaces == nullptr ? 0 : SurfacesOf(scene));
  lights.resize(from.lights == nullptr ? 0 : scene.lights.size());
  gradients.positions = SpanOf(from.positions, scene.positions.size());
  gradients.camera = from.camera == nullptr ? nullptr : &camera;
  gradients.colors = SpanOf(from.colors, scene.colors.values.size());
  gradients.uvs = SpanOf(from.uvs, scene.uvs.values.size());
  gradients.normals = SpanOf(from.normals, scene.normals.values.size());
  gradients.textures = textures, gradients.surfaces = surfaces, gradients.lights = lights;
  gradients.light_directions = SpanOf(from.light_directions, scene.light_directions.size());
  gradients.sh = SpanOf(from.sh, scene.sh.size());
  gradients.attributes = SpanOf(from.attributes, scene.attributes.values.size());
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

void CGradients::AddTo(const tilegrad_scene_gradients& to) const {
  if (to.camera != nullptr) AddCamera(camera, to.camera);
  for (std::size_t i = 0; i < surfaces.size(); ++i) AddSurface(surfaces[i], &to.surfaces[i]);
  for (std::size_t i = 0; i < lights.size(); ++i) {
    Add(lights[i].direction, to.lights[i].direction);
    to.lights[i].intensity += lights[i].intensity;
  }
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
  return {from.color != 0,   from.alpha != 0, from.attributes != 0,  from.depth != 0,
          from.normals != 0, from.uv != 0,    from.barycentrics != 0};
}

tilegrad_camera CameraOf(const Camera& from) {
  tilegrad_camera to = {};
  AddCamera(from, &to);
  to.near_plane = from.near_plane;
  return to;
}

FrameGradients FrameGradientsOf(const tilegrad_frame_gradients& from, const Images& images) {
  const std::size_t pixels = images.face_ids.size();
  FrameGradients to;
  to.color = SpanOf(from.color, 3 * pixels), to.alpha = SpanOf(from.alpha, pixels);
  to.attributes = SpanOf(from.attributes, static_cast<std::size_t>(images.channels) * pixels);
  to.depth = SpanOf(from.depth, pixels), to.normals = SpanOf(from.normals, 3 * pixels);
  to.uv = SpanOf(from.uv, 2 * pixels);
  return to;
}

tilegrad_images ImagesOf(const Images& from) {
  tilegrad_images to = {};
  to.count = from.count, to.height = from.height, to.width = from.width;
  to.channels = from.channels;
  to.face_ids = from.face_ids.empty() ? nullptr : from.face_ids.data();
  to.color = DataOf(from.color), to.alpha = DataOf(from.alpha);
  to.attributes = DataOf(from.attributes), to.depth = DataOf(from.depth);
  to.normals = DataOf(from.normals), to.uv = DataOf(from.uv);
  to.barycentrics = DataOf(from.barycentrics);
  to.alpha_error_bound = from.alpha_error_bound;
  return to;
}

}  // namespace tilegrad::v0
