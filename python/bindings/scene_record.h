// SPDX-License-Identifier: Apache-2.0
// A tilegrad.Scene as the records of the public interface: one for each image, views over the
// caller's arrays.
#pragma once

#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings/arrays.h"
#include "bindings/camera_numbers.h"
#include "render/scene_fields.h"

namespace tilegrad::python {

inline constexpr std::size_t kSurfaceNumbers = 13;  // base, ambient, diffuse, specular, shininess
inline constexpr std::size_t kLightNumbers = 4;     // direction, intensity

// The plain numbers of a record, in the order above. Surfaces: all but the texture.
template <class T>
SurfaceT<T> SurfaceOf(std::span<const T> numbers);
template <class T>
void PutSurface(const SurfaceT<T>& surface, std::span<T> numbers);
template <class T>
LightT<T> LightOf(std::span<const T> numbers);
template <class T>
void PutLight(const LightT<T>& light, std::span<T> numbers);

// The arrays from Python. Shapes are those of include/tilegrad/scene.h; an additional leading axis
// of length `count` holds each image's own.
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

// A field of a scene for every image of a batch: one array that all share, or one with an
// additional leading axis, which holds each image's own. T is const for inputs.
template <class T>
class Field {
 public:
  Field() = default;

  // `array`: None, or a C-contiguous array of `shape` or [count, shape...]. TypeError or ValueError
  // otherwise. Valid while the array lives.
  Field(const char* function, const char* argument, const py::object& array,
        const std::vector<py::ssize_t>& shape, std::size_t count) {
    if (array.is_none()) return;
    const auto values = py::reinterpret_borrow<py::array>(array);
    own_ = py::isinstance<py::array>(array) &&
           static_cast<std::size_t>(values.ndim()) == shape.size() + 1;
    std::vector<py::ssize_t> expected = shape;
    if (own_) expected.insert(expected.begin(), static_cast<py::ssize_t>(count));
    all_ = TakeSpan(function, argument, array, expected);
    size_ = own_ && count > 0 ? all_.size() / count : all_.size();
    given_ = true;
  }

  bool given() const { return given_; }
  bool own() const { return own_; }  // each image's own
  std::size_t arrays() const { return own_ && size_ > 0 ? all_.size() / size_ : 1; }
  std::span<T> all() const { return all_; }
  std::span<T> Of(std::size_t image) const { return all_.subspan(own_ ? image * size_ : 0, size_); }

 private:
  static std::span<T> TakeSpan(const char* function, const char* argument, const py::object& array,
                               const std::vector<py::ssize_t>& shape) {
    if constexpr (std::is_const_v<T>) {
      return SpanOf<std::remove_const_t<T>>(array, function, argument, shape);
    } else {
      return MutableSpanOf<T>(array, function, argument, shape);
    }
  }

  std::span<T> all_;
  std::size_t size_ = 0;  // of one image
  bool given_ = false, own_ = false;
};

template <class T>
class SceneRecord {
 public:
  // ValueError or TypeError for an array of another shape or dtype.
  SceneRecord(std::size_t count, SceneArrays arrays);
  SceneRecord(const SceneRecord&) = delete;  // `scenes_` refers to the other members
  SceneRecord& operator=(const SceneRecord&) = delete;

  const std::vector<SceneT<T>>& scenes() const { return scenes_; }
  std::size_t count() const { return scenes_.size(); }
  int channels() const { return channels_; }  // of attributes; known even without images
  const SceneArrays& arrays() const { return arrays_; }

  // The Python index of an element that the engine counts one by one: "faces[2,1]" for number 7 of
  // "faces". Elements of records keep their number.
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
  int channels_ = 0;
  std::vector<SceneT<T>> scenes_;
  std::vector<TextureT<T>> textures_;  // of image 0, of image 1, ...
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;  // as textures_
};

}  // namespace tilegrad::python
