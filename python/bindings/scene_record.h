// SPDX-License-Identifier: Apache-2.0
// A tilegrad.Scene as the records of the public interface: one for each image, views over the
// caller's arrays.
#pragma once

#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings/camera_numbers.h"
#include "bindings/field.h"
#include "render/scene_fields.h"

namespace tilegrad::python {

inline constexpr std::size_t kSurfaceNumbers = 13;  // base, ambient, diffuse, specular, shininess
inline constexpr std::size_t kLightNumbers = 4;     // direction, intensity

// The plain numbers of a record, in the order above. Surfaces: all but the texture.
template <class T>
CameraT<T> CameraOf(std::span<const T> numbers);
template <class T>
void PutCamera(const CameraT<T>& camera, std::span<T> numbers);
template <class T>
SurfaceT<T> SurfaceOf(std::span<const T> numbers);
template <class T>
void PutSurface(const SurfaceT<T>& surface, std::span<T> numbers);
template <class T>
LightT<T> LightOf(std::span<const T> numbers);
template <class T>
void PutLight(const LightT<T>& light, std::span<T> numbers);

// What Python hands over. Shapes are those of include/tilegrad/scene.h; a leading axis of `count`
// numbers is each image's own.
struct SceneArrays {
  py::dict fields;  // by the names of SceneT's members: positions, faces, streams, sh,
                    // face_surfaces; camera [17], lights [L,4], surfaces [S,13]
  std::vector<std::string> per_corner;  // which streams are [F,3,C], not [V,C]
  std::vector<py::object> textures;     // [height,width,3]
  std::vector<int> wraps, filters;      // of textures
  std::vector<int> surface_textures;    // [S]
  std::tuple<int, int, bool, bool> shading = {0, 0, false, false};  // members of ShadingModel

  py::object operator[](const char* name) const;  // None: not there
  bool at_corners(std::string_view name) const;
};

template <class T>
class SceneRecord {
 public:
  // ValueError or TypeError for an array of another shape or dtype.
  SceneRecord(std::size_t count, SceneArrays arrays);
  SceneRecord(const SceneRecord&) = delete;  // `scenes_` looks at the other members
  SceneRecord& operator=(const SceneRecord&) = delete;

  const std::vector<SceneT<T>>& scenes() const { return scenes_; }
  std::size_t count() const { return scenes_.size(); }
  int channels() const { return channels_; }  // of attributes, where there is no image, too
  const SceneArrays& arrays() const { return arrays_; }

  // The number of an array that the engine counts one by one, as Python has it: "faces[2,1]" of
  // number 7 of "faces". Numbers of records keep theirs.
  std::string PlaceOf(std::string_view name, std::size_t number) const;

 private:
  void SetStreams();
  void SetTextures();
  void SetSurfaces();
  void SetLights();
  template <class U>
  Field<const U> Take(const char* name, const py::object& array, std::vector<py::ssize_t> shape) {
    return Field<const U>("Scene", name, array, shape, scenes_.size());
  }
  template <class U>
  Field<const U> Take(const char* name, std::vector<py::ssize_t> shape) {
    return Take<U>(name, arrays_[name], std::move(shape));
  }

  SceneArrays arrays_;  // keeps them alive
  py::ssize_t vertices_ = 0, faces_ = 0;
  int channels_ = 0;
  std::vector<SceneT<T>> scenes_;
  std::vector<TextureT<T>> textures_;  // of image 0, of image 1, ...
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;  // as textures_
};

}  // namespace tilegrad::python
