// SPDX-License-Identifier: Apache-2.0
#include "bindings/scene_record.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace tilegrad::python {
namespace {

// Copies runs of numbers between a record's members and an array.
template <class T>
class Reader {
 public:
  explicit Reader(std::span<const T> from) : from_(from.data()) {}
  template <class Out>
  void operator()(Out& out) {
    for (T& x : out) x = *from_++;
  }
  void operator()(T& out) { out = *from_++; }

 private:
  const T* from_;
};

template <class T>
class Writer {
 public:
  explicit Writer(std::span<T> to) : to_(to.data()) {}
  template <class In>
  void operator()(const In& in) {
    for (const T x : in) *to_++ = x;
  }
  void operator()(const T& in) { *to_++ = in; }

 private:
  T* to_;
};

// The order of a record's numbers, for both directions.
template <class Move, class Camera>
void MoveCamera(Move move, Camera& c) {
  move(c.rotation), move(c.translation), move(c.fx), move(c.fy), move(c.cx), move(c.cy);
  move(c.near_plane);
}
template <class Move, class Surface>
void MoveSurface(Move move, Surface& s) {
  move(s.base_color), move(s.ambient), move(s.diffuse), move(s.specular), move(s.shininess);
}
template <class Move, class Light>
void MoveLight(Move move, Light& light) {
  move(light.direction), move(light.intensity);
}

py::ssize_t Length(const py::object& array, py::ssize_t axis_from_end) {
  if (!py::isinstance<py::array>(array)) return 0;
  const auto values = py::reinterpret_borrow<py::array>(array);
  return values.ndim() < axis_from_end ? 0 : values.shape(values.ndim() - axis_from_end);
}

}  // namespace

template <class T>
v0::CameraT<T> CameraOf(std::span<const T> numbers) {
  v0::CameraT<T> out;
  MoveCamera(Reader<T>(numbers), out);
  return out;
}
template <class T>
void PutCamera(const v0::CameraT<T>& camera, std::span<T> numbers) {
  MoveCamera(Writer<T>(numbers), camera);
}
template <class T>
v0::SurfaceT<T> SurfaceOf(std::span<const T> numbers) {
  v0::SurfaceT<T> out;
  MoveSurface(Reader<T>(numbers), out);
  return out;
}
template <class T>
void PutSurface(const v0::SurfaceT<T>& surface, std::span<T> numbers) {
  MoveSurface(Writer<T>(numbers), surface);
}
template <class T>
v0::LightT<T> LightOf(std::span<const T> numbers) {
  v0::LightT<T> out;
  MoveLight(Reader<T>(numbers), out);
  return out;
}
template <class T>
void PutLight(const v0::LightT<T>& light, std::span<T> numbers) {
  MoveLight(Writer<T>(numbers), light);
}

template <class T>
SceneRecord<T>::SceneRecord(std::size_t count, SceneArrays arrays)
    : arrays_(std::move(arrays)),
      vertices_(Length(arrays_.positions, 2)),
      faces_(Length(arrays_.faces, 2)),
      scenes_(count) {
  const auto positions = Take<T>("positions", arrays_.positions, {vertices_, 3});
  const auto faces = Take<std::int32_t>("faces", arrays_.faces, {faces_, 3});
  const auto cameras = Take<T>("camera", arrays_.camera, {kCameraNumbers});
  for (std::size_t n = 0; n < count; ++n) {
    v0::SceneT<T>& scene = scenes_[n];
    scene.positions = positions.Of(n), scene.faces = faces.Of(n);
    scene.camera = CameraOf(cameras.Of(n));
    scene.shading = {static_cast<v0::Lighting>(arrays_.lighting),
                     static_cast<v0::Normals>(arrays_.normal_kind), arrays_.two_sided,
                     arrays_.clamp};
  }
  SetStreams(), SetTextures(), SetSurfaces(), SetLights();
}

template <class T>
void SceneRecord<T>::SetStreams() {
  struct Stream {
    const char* name;
    const py::object& array;
    py::ssize_t width;
    v0::StreamT<T> v0::SceneT<T>::*member;
  };
  const py::ssize_t channels = Length(arrays_.attributes, 1);
  const Stream streams[] = {
      {"colors", arrays_.colors, 3, &v0::SceneT<T>::colors},
      {"uvs", arrays_.uvs, 2, &v0::SceneT<T>::uvs},
      {"normals", arrays_.normals, 3, &v0::SceneT<T>::normals},
      {"attributes", arrays_.attributes, channels, &v0::SceneT<T>::attributes}};
  arrays_.per_corner.resize(std::size(streams));
  for (std::size_t i = 0; i < std::size(streams); ++i) {
    const Stream& s = streams[i];
    const bool corner = arrays_.per_corner[i];
    const auto field = corner ? Take<T>(s.name, s.array, {faces_, 3, s.width})
                              : Take<T>(s.name, s.array, {vertices_, s.width});
    if (!field.given()) continue;
    for (std::size_t n = 0; n < scenes_.size(); ++n) {
      scenes_[n].*s.member = {field.Of(n), corner ? v0::Rate::kCorner : v0::Rate::kVertex};
    }
  }
  constexpr py::ssize_t kMost = std::numeric_limits<int>::max();  // more than the engine takes
  for (v0::SceneT<T>& scene : scenes_) scene.channels = static_cast<int>(std::min(channels, kMost));
}

template <class T>
void SceneRecord<T>::SetTextures() {
  const std::size_t each = arrays_.textures.size();
  if (arrays_.wraps.size() != each || arrays_.filters.size() != each) {
    throw py::value_error("Scene: textures, wraps and filters differ in length");
  }
  textures_.resize(each * scenes_.size());
  for (std::size_t i = 0; i < each; ++i) {
    const py::object& texels = arrays_.textures[i];
    const py::ssize_t height = Length(texels, 3), width = Length(texels, 2);
    const auto field = Take<T>("textures", texels, {height, width, 3});
    for (std::size_t n = 0; n < scenes_.size(); ++n) {
      textures_[n * each + i] = {field.Of(n), static_cast<int>(width), static_cast<int>(height),
                                 static_cast<v0::Wrap>(arrays_.wraps[i]),
                                 static_cast<v0::Filter>(arrays_.filters[i])};
    }
  }
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].textures = std::span<const v0::TextureT<T>>(textures_).subspan(n * each, each);
  }
}

template <class T>
void SceneRecord<T>::SetSurfaces() {
  const auto indices = Take<std::int32_t>("face_surfaces", arrays_.face_surfaces, {faces_});
  const auto count = static_cast<py::ssize_t>(arrays_.surface_textures.size());
  if (!arrays_.surfaces.is_none()) {
    const auto numbers = SpanOf<T>(arrays_.surfaces, "Scene", "surfaces",
                                   {count, static_cast<py::ssize_t>(kSurfaceNumbers)});
    for (std::size_t i = 0; i < arrays_.surface_textures.size(); ++i) {
      surfaces_.push_back(SurfaceOf<T>(numbers.subspan(i * kSurfaceNumbers, kSurfaceNumbers)));
      surfaces_.back().texture = arrays_.surface_textures[i];
    }
  }
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].surfaces = surfaces_;
    if (indices.given()) scenes_[n].face_surfaces = indices.Of(n);
  }
}

template <class T>
void SceneRecord<T>::SetLights() {
  const py::ssize_t each = Length(arrays_.lights, 2);
  const auto lights = Take<T>("lights", arrays_.lights, {each, kLightNumbers});
  const auto directions = Take<T>("light_directions", arrays_.light_directions, {vertices_, 3});
  const auto sh = Take<T>("sh", arrays_.sh, {9});
  lights_.resize(static_cast<std::size_t>(each) * lights.arrays());
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    lights_[i] = LightOf<T>(lights.all().subspan(i * kLightNumbers, kLightNumbers));
  }
  const auto length = static_cast<std::size_t>(each);
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].lights =
        std::span<const v0::LightT<T>>(lights_).subspan(lights.own() ? n * length : 0, length);
    if (directions.given()) scenes_[n].light_directions = directions.Of(n);
    if (sh.given()) scenes_[n].sh = sh.Of(n);
  }
}

#define TILEGRAD_INSTANTIATE(T)                                   \
  template v0::CameraT<T> CameraOf(std::span<const T>);           \
  template void PutCamera(const v0::CameraT<T>&, std::span<T>);   \
  template v0::SurfaceT<T> SurfaceOf(std::span<const T>);         \
  template void PutSurface(const v0::SurfaceT<T>&, std::span<T>); \
  template v0::LightT<T> LightOf(std::span<const T>);             \
  template void PutLight(const v0::LightT<T>&, std::span<T>);     \
  template class SceneRecord<T>;
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::python
