// SPDX-License-Identifier: Apache-2.0
// Arrays of Python that a backward pass writes to, as the records of the public interface.
#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "bindings/scene_record.h"

namespace tilegrad::python {

template <class T>
class GradientRecord {
 public:
  // `arrays`: from the names of SceneArrays' fields, and textures (a list with None
  // for what is not wanted), to arrays of the same shapes, or with a leading axis more for a
  // gradient of each image. What is missing is not wanted. ValueError or TypeError for an array of
  // another shape or dtype, or one that is read-only.
  GradientRecord(const SceneRecord<T>& scene, const py::dict& arrays, GradientMode mode);
  GradientRecord(GradientRecord&&) noexcept = default;

  const std::vector<SceneGradientsT<T>>& gradients() const { return gradients_; }
  // What is not a plain array in C++, from the records to the arrays.
  void Store() const;

 private:
  Field<T> Take(const char* name, const py::object& array, const std::vector<py::ssize_t>& shape);
  Field<T> Take(const char* name, const std::vector<py::ssize_t>& shape);
  void SetStreams(const SceneRecord<T>& scene);
  void SetTextures(const SceneRecord<T>& scene);
  void SetRecords(const SceneRecord<T>& scene);

  const py::object* Find(std::string_view name) const;  // null: not wanted

  GradientMode mode_;
  std::vector<std::pair<std::string_view, py::object>> arrays_;
  std::vector<SceneGradientsT<T>> gradients_;
  std::vector<std::span<T>> textures_;
  Field<T> camera_, surface_, light_;
  std::vector<CameraT<T>> cameras_;
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;
};

}  // namespace tilegrad::python
