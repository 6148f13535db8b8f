// SPDX-License-Identifier: Apache-2.0
#include "bindings/gradient_record.h"

#include <algorithm>

namespace tilegrad::python {
namespace {

// The shape of what one image has of `array`.
std::vector<py::ssize_t> ShapeOfOne(const py::object& array, std::size_t axes) {
  if (array.is_none()) return {};
  const auto shape = ShapeOf(py::reinterpret_borrow<py::array>(array));
  return {shape.end() - static_cast<std::ptrdiff_t>(axes), shape.end()};
}

// Records of runs of `numbers` numbers.
template <class T, class Record, class Read>
void ReadAll(const Field<T>& from, std::size_t numbers, std::vector<Record>* to, Read read) {
  const std::span<const T> all = from.all();
  for (std::size_t i = 0; i < all.size(); i += numbers)
    to->push_back(read(all.subspan(i, numbers)));
}

template <class T, class Record, class Put>
void PutAll(const std::vector<Record>& from, std::size_t numbers, const Field<T>& to, Put put) {
  for (std::size_t i = 0; i < from.size(); ++i)
    put(from[i], to.all().subspan(i * numbers, numbers));
}

}  // namespace

template <class T>
GradientRecord<T>::GradientRecord(const SceneRecord<T>& scene, const py::dict& arrays,
                                  GradientMode mode)
    : mode_(mode), gradients_(scene.count()) {
  for (const std::pair<py::handle, py::handle> entry : arrays) {
    arrays_.emplace_back(py::cast<std::string_view>(entry.first),
                         py::reinterpret_borrow<py::object>(entry.second));
  }
  SetStreams(scene);
  SetTextures(scene);
  SetRecords(scene);
}

// The names live as long as the dictionary, which lives as long as the call.
template <class T>
const py::object* GradientRecord<T>::Find(std::string_view name) const {
  for (const auto& [known, array] : arrays_) {
    if (known == name) return &array;
  }
  return nullptr;
}

template <class T>
Field<T> GradientRecord<T>::Take(const char* name, const py::object& array,
                                 const std::vector<py::ssize_t>& shape) {
  const Field<T> field("backward", name, array, shape, gradients_.size());
  // Without images nothing else writes what images share: their sum.
  const bool clear = gradients_.empty() && mode_ == GradientMode::kOverwrite;
  if (clear) std::fill(field.all().begin(), field.all().end(), T(0));
  return field;
}

template <class T>
Field<T> GradientRecord<T>::Take(const char* name, const std::vector<py::ssize_t>& shape) {
  const py::object* array = Find(name);
  return array == nullptr ? Field<T>() : Take(name, *array, shape);
}

template <class T>
void GradientRecord<T>::SetStreams(const SceneRecord<T>& scene) {
  SceneGradientsT<T> names;
  const SceneArrays& a = scene.arrays();
  ForEachPlainArray(names, [&](const char* name, auto&) {
    if (Find(name) == nullptr) return;
    const std::size_t axes = a.at_corners(name) ? 3 : name == std::string_view("sh") ? 1 : 2;
    const auto field = Take(name, ShapeOfOne(a[name], axes));
    for (std::size_t n = 0; field.given() && n < gradients_.size(); ++n) {
      ForEachPlainArray(gradients_[n], [&](std::string_view to, std::span<T>& array) {
        if (to == name) array = field.Of(n);
      });
    }
  });
}

template <class T>
void GradientRecord<T>::SetTextures(const SceneRecord<T>& scene) {
  const py::object* wanted = Find("textures");
  if (wanted == nullptr) return;
  const py::sequence given = *wanted;
  const std::size_t each = scene.arrays().textures.size();
  if (py::len(given) != each) {
    throw py::value_error(fmt::format("backward: textures has {} gradients, the scene {} textures",
                                      py::len(given), each));
  }
  textures_.resize(each * gradients_.size());
  for (std::size_t i = 0; i < each; ++i) {
    const auto field = Take("textures", given[i], ShapeOfOne(scene.arrays().textures[i], 3));
    for (std::size_t n = 0; field.given() && n < gradients_.size(); ++n) {
      textures_[n * each + i] = field.Of(n);
    }
  }
  for (std::size_t n = 0; n < gradients_.size(); ++n) {
    gradients_[n].textures = std::span<const std::span<T>>(textures_).subspan(n * each, each);
  }
}

template <class T>
void GradientRecord<T>::SetRecords(const SceneRecord<T>& scene) {
  const SceneArrays& a = scene.arrays();
  const auto surfaces = std::max<py::ssize_t>(static_cast<py::ssize_t>(a.surface_textures.size()),
                                              1);  // none: the default
  camera_ = Take("camera", {kCameraNumbers});
  surface_ = Take("surfaces", {surfaces, kSurfaceNumbers});
  light_ = Take("lights", ShapeOfOne(a["lights"], 2));
  ReadAll(camera_, kCameraNumbers, &cameras_, CameraOf<T>);
  ReadAll(surface_, kSurfaceNumbers, &surfaces_, SurfaceOf<T>);
  ReadAll(light_, kLightNumbers, &lights_, LightOf<T>);
  const auto of = [](auto& all, const Field<T>& field, std::size_t n) {
    const std::size_t each = all.size() / field.arrays();
    return std::span(all).subspan(field.own() ? n * each : 0, each);
  };
  for (std::size_t n = 0; n < gradients_.size(); ++n) {
    if (!cameras_.empty()) gradients_[n].camera = of(cameras_, camera_, n).data();
    gradients_[n].surfaces = of(surfaces_, surface_, n);
    gradients_[n].lights = of(lights_, light_, n);
  }
}

template <class T>
void GradientRecord<T>::Store() const {
  PutAll(cameras_, kCameraNumbers, camera_, PutCamera<T>);
  PutAll(surfaces_, kSurfaceNumbers, surface_, PutSurface<T>);
  PutAll(lights_, kLightNumbers, light_, PutLight<T>);
}

template class GradientRecord<float>;
template class GradientRecord<double>;

}  // namespace tilegrad::python
