// SPDX-License-Identifier: Apache-2.0
#include "api/convert.h"

#include <algorithm>
#include <cstddef>

namespace tilegrad::v0 {
namespace {

// Enumerations have the same order here and there.
template <class To, class From>
To Cast(From from) {
  return static_cast<To>(from);
}
template <class A, class B>
constexpr bool Same(A a, B b) {
  return static_cast<int>(a) == static_cast<int>(b);
}
static_assert(Same(Rate::kCorner, engine::AttributeRate::kCorner));
static_assert(Same(Wrap::kClamp, engine::shade::Wrap::kClamp));
static_assert(Same(Wrap::kMirror, engine::shade::Wrap::kMirror));
static_assert(Same(Filter::kBilinear, engine::shade::Filter::kBilinear));
static_assert(Same(Filter::kTrilinear, engine::shade::Filter::kTrilinear));
static_assert(Same(Lighting::kLambert, engine::Lighting::kLambert));
static_assert(Same(Lighting::kPhong, engine::Lighting::kPhong));
static_assert(Same(Lighting::kSphericalHarmonics, engine::Lighting::kSphericalHarmonics));
static_assert(Same(Normals::kFlat, engine::NormalKind::kFlat));
static_assert(Same(Normals::kGiven, engine::NormalKind::kGiven));
static_assert(Same(Interpolation::kScreenLinear, engine::Interpolation::kScreenLinear));
static_assert(Same(FaceCulling::kBack, engine::FaceCulling::kBack));
static_assert(Same(AlphaRule::kPaper, engine::SoftRule::kPaper));

template <class T>
engine::AttributeStreamT<T> ToEngine(const StreamT<T>& stream) {
  return {stream.values, Cast<engine::AttributeRate>(stream.rate)};
}

template <class T>
engine::shade::TextureViewT<T> ToEngine(const TextureT<T>& t) {
  return {t.texels,
          t.width,
          t.height,
          3,
          Cast<engine::shade::Wrap>(t.wrap),
          Cast<engine::shade::Filter>(t.filter)};
}

template <class T>
engine::SurfaceT<T> ToEngine(const SurfaceT<T>& s) {
  return {s.base_color, s.texture, s.ambient, s.diffuse, s.specular, s.shininess};
}

engine::ShadingModel ToEngine(const ShadingModel& model) {
  engine::ShadingModel out;
  out.lighting = Cast<engine::Lighting>(model.lighting);
  out.normals = Cast<engine::NormalKind>(model.normals);
  out.two_sided = model.two_sided, out.clamp = model.clamp;
  return out;
}

template <class T>
void FillRecords(const SceneT<T>& scene, SceneRecords<T>* records) {
  records->textures.clear(), records->surfaces.clear(), records->lights.clear();
  for (const auto& texture : scene.textures) records->textures.push_back(ToEngine(texture));
  for (const auto& surface : scene.surfaces) records->surfaces.push_back(ToEngine(surface));
  for (const auto& light : scene.lights) {
    records->lights.push_back({light.direction, light.intensity});
  }
}

template <class T>
void AddAll(std::span<const T> from, std::span<T> to) {
  for (std::size_t i = 0; i < from.size(); ++i) to[i] += from[i];
}

template <class T>
void AddCamera(const engine::CameraT<T>& from, CameraT<T>* to) {
  AddAll<T>(from.rotation, to->rotation), AddAll<T>(from.translation, to->translation);
  to->fx += from.fx, to->fy += from.fy, to->cx += from.cx, to->cy += from.cy;
}

template <class T>
void ClearCamera(CameraT<T>* camera) {
  std::fill_n(camera->rotation, 9, T(0)), std::fill_n(camera->translation, 3, T(0));
  camera->fx = camera->fy = camera->cx = camera->cy = camera->near_plane = T(0);
}

}  // namespace

template <class T>
engine::CameraT<T> ToEngine(const CameraT<T>& camera) {
  engine::CameraT<T> out;
  std::copy_n(camera.rotation, 9, out.rotation);
  std::copy_n(camera.translation, 3, out.translation);
  out.fx = camera.fx, out.fy = camera.fy, out.cx = camera.cx, out.cy = camera.cy;
  out.near_plane = camera.near_plane;
  return out;
}

template <class T>
engine::ShadedSceneT<T> ToEngine(const SceneT<T>& scene, SceneRecords<T>* records) {
  FillRecords(scene, records);
  engine::ShadedSceneT<T> out;
  out.positions = scene.positions, out.faces = scene.faces, out.camera = ToEngine(scene.camera);
  out.attributes = scene.attributes.values, out.channels = scene.channels;
  out.rate = Cast<engine::AttributeRate>(scene.attributes.rate);
  out.model = ToEngine(scene.shading);
  out.colors = ToEngine(scene.colors), out.uvs = ToEngine(scene.uvs);
  out.normals = ToEngine(scene.normals);
  out.textures = records->textures, out.surfaces = records->surfaces;
  out.face_surfaces = scene.face_surfaces, out.lights = records->lights;
  out.light_directions = scene.light_directions, out.sh = scene.sh;
  return out;
}

engine::RenderOptions ToEngine(const RenderOptions& options) {
  engine::RenderOptions out;
  out.width = options.width, out.height = options.height;
  out.delta = options.delta, out.max_alpha_error = options.max_alpha_error;
  out.interpolation = Cast<engine::Interpolation>(options.interpolation);
  out.culling = Cast<engine::FaceCulling>(options.culling);
  out.soft_rule = Cast<engine::SoftRule>(options.alpha_rule);
  out.paper.box = options.paper_box, out.paper.max_faces = options.paper_faces;
  return out;
}

engine::ShadedRequest ToEngine(const Outputs& outputs) {
  engine::ShadedRequest out;
  out.attributes = outputs.attributes, out.alpha = outputs.alpha, out.depth = outputs.depth;
  out.barycentrics = outputs.barycentrics, out.color = outputs.color;
  out.normals = outputs.normals, out.uv = outputs.uv;
  return out;
}

template <class T>
engine::ShadedFrameGradientsT<T> ToEngine(const FrameGradientsT<T>& d_frame) {
  engine::ShadedFrameGradientsT<T> out;
  out.attributes = d_frame.attributes, out.alpha = d_frame.alpha;
  out.color = d_frame.color, out.normals = d_frame.normals, out.uv = d_frame.uv;
  out.depth = d_frame.depth;
  return out;
}

template <class T>
ImagesT<T> ImagesOf(const engine::ShadedFrameT<T>& frame) {
  ImagesT<T> out;
  out.count = frame.images, out.height = frame.height, out.width = frame.width;
  out.channels = frame.channels;
  out.face_ids = frame.face_ids, out.color = frame.color, out.alpha = frame.alpha;
  out.attributes = frame.attributes, out.depth = frame.depth, out.normals = frame.normals;
  out.uv = frame.uv, out.barycentrics = frame.barycentrics;
  out.alpha_error_bound = frame.alpha_error_bound;
  return out;
}

template <class T>
engine::ShadedGradientsT<T> ToEngine(const SceneGradientsT<T>& d, GradientRecords<T>* records) {
  records->surfaces.resize(d.surfaces.size()), records->lights.resize(d.lights.size());
  engine::ShadedGradientsT<T> out;
  out.positions = d.positions, out.attributes = d.attributes, out.camera = d.camera != nullptr;
  out.colors = d.colors, out.uvs = d.uvs, out.normals = d.normals;
  out.light_directions = d.light_directions, out.sh = d.sh, out.textures = d.textures;
  out.surfaces = records->surfaces, out.lights = records->lights;
  return out;
}

template <class T>
void ClearRecords(const SceneGradientsT<T>& d) {
  if (d.camera != nullptr) ClearCamera(d.camera);
  for (LightT<T>& light : d.lights) light = {{T(0), T(0), T(0)}, T(0)};
  for (SurfaceT<T>& s : d.surfaces) {
    s.base_color = s.ambient = s.diffuse = s.specular = {};
    s.shininess = T(0);
  }
}

template <class T>
void AddRecords(const engine::ShadedGradientsT<T>& from, const SceneGradientsT<T>& d) {
  if (d.camera != nullptr) AddCamera(from.d_camera, d.camera);
  for (std::size_t i = 0; i < d.lights.size(); ++i) {
    AddAll<T>(from.lights[i].direction, d.lights[i].direction);
    d.lights[i].intensity += from.lights[i].intensity;
  }
  for (std::size_t i = 0; i < d.surfaces.size(); ++i) {
    const engine::SurfaceT<T>& s = from.surfaces[i];
    AddAll<T>(s.base_color, d.surfaces[i].base_color), AddAll<T>(s.ambient, d.surfaces[i].ambient);
    AddAll<T>(s.diffuse, d.surfaces[i].diffuse), AddAll<T>(s.specular, d.surfaces[i].specular);
    d.surfaces[i].shininess += s.shininess;
  }
}

#define TILEGRAD_INSTANTIATE(T)                                                                  \
  template engine::CameraT<T> ToEngine(const CameraT<T>&);                                       \
  template engine::ShadedSceneT<T> ToEngine(const SceneT<T>&, SceneRecords<T>*);                 \
  template engine::ShadedFrameGradientsT<T> ToEngine(const FrameGradientsT<T>&);                 \
  template ImagesT<T> ImagesOf(const engine::ShadedFrameT<T>&);                                  \
  template engine::ShadedGradientsT<T> ToEngine(const SceneGradientsT<T>&, GradientRecords<T>*); \
  template void ClearRecords(const SceneGradientsT<T>&);                                         \
  template void AddRecords(const engine::ShadedGradientsT<T>&, const SceneGradientsT<T>&);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::v0
