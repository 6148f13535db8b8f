// SPDX-License-Identifier: Apache-2.0
// A tilegrad.Scene as the records of the public interface: one for each image, views over the
// caller's arrays.
#pragma once

#include <vector>

#include "bindings/camera_numbers.h"
#include "bindings/field.h"
#include "tilegrad/renderer.h"

namespace tilegrad::python {

inline constexpr std::size_t kSurfaceNumbers = 13;  // base, ambient, diffuse, specular, shininess
inline constexpr std::size_t kLightNumbers = 4;     // direction, intensity

// The plain numbers of a record, in the order above. Surfaces: all but the texture.
template <class T>
v0::CameraT<T> CameraOf(std::span<const T> numbers);
template <class T>
void PutCamera(const v0::CameraT<T>& camera, std::span<T> numbers);
template <class T>
v0::SurfaceT<T> SurfaceOf(std::span<const T> numbers);
template <class T>
void PutSurface(const v0::SurfaceT<T>& surface, std::span<T> numbers);
template <class T>
v0::LightT<T> LightOf(std::span<const T> numbers);
template <class T>
void PutLight(const v0::LightT<T>& light, std::span<T> numbers);

// What Python hands over; None: not there. A leading axis of `count` numbers is each image's own.
struct SceneArrays {
  py::object positions = py::none(), faces = py::none();  // [V,3], [F,3] int32
  py::object camera = py::none();                         // [17]
  // [V,C], or [F,3,C] if per corner.
  py::object colors = py::none(), uvs = py::none(), normals = py::none(), attributes = py::none();
  std::vector<bool> per_corner;           // of the four above
  std::vector<py::object> textures;       // [height,width,3]
  std::vector<int> wraps, filters;        // of textures
  py::object surfaces = py::none();       // [S,13]
  std::vector<int> surface_textures;      // [S]
  py::object face_surfaces = py::none();  // [F] int32
  // [L,4], [V,3], [9]
  py::object lights = py::none(), light_directions = py::none(), sh = py::none();
  int lighting = 0, normal_kind = 0;
  bool two_sided = false, clamp = false;
};

template <class T>
class SceneRecord {
 public:
  // ValueError or TypeError for an array of another shape or dtype.
  SceneRecord(std::size_t count, SceneArrays arrays);
  SceneRecord(const SceneRecord&) = delete;  // `scenes_` looks at the other members
  SceneRecord& operator=(const SceneRecord&) = delete;

  const std::vector<v0::SceneT<T>>& scenes() const { return scenes_; }
  std::size_t count() const { return scenes_.size(); }
  const SceneArrays& arrays() const { return arrays_; }

 private:
  void SetStreams();
  void SetTextures();
  void SetSurfaces();
  void SetLights();
  template <class U>
  Field<const U> Take(const char* name, const py::object& array, std::vector<py::ssize_t> shape) {
    return Field<const U>("Scene", name, array, shape, scenes_.size());
  }

  SceneArrays arrays_;  // keeps them alive
  py::ssize_t vertices_ = 0, faces_ = 0;
  std::vector<v0::SceneT<T>> scenes_;
  std::vector<v0::TextureT<T>> textures_;  // of image 0, of image 1, ...
  std::vector<v0::SurfaceT<T>> surfaces_;
  std::vector<v0::LightT<T>> lights_;  // as textures_
};

}  // namespace tilegrad::python
