// SPDX-License-Identifier: Apache-2.0
// Where gradients go: arrays of the caller, which scenes of a batch may share whole. An array that
// is shorter for one scene than for another, or that two gradients of different kinds meet in,
// would be written beyond its end or hold a part of a sum.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "render/scene_fields.h"

namespace tilegrad {

template <class T>
class GradientArrays {
 public:
  // Errors: two arrays that have memory in common and are not the same array for the same thing.
  Status Check(std::span<const SceneT<T>> scenes, std::span<const SceneGradientsT<T>> gradients) {
    arrays_.clear();
    const SceneT<T> nothing;
    for (std::size_t n = 0; n < gradients.size(); ++n) {
      const SceneT<T>& scene = n < scenes.size() ? scenes[n] : nothing;
      ForEachGradientArray(scene, gradients[n],
                           [&](const char* name, std::span<T> array, int width) {
                             if (!array.empty())
                               arrays_.push_back({array.data(), array.size(), n, name, width});
                           });
    }
    std::sort(arrays_.begin(), arrays_.end(), Before);
    for (std::size_t i = 1; i < arrays_.size(); ++i) {
      const Array &a = arrays_[i - 1], &b = arrays_[i];
      if (!std::less<const T*>()(b.data, a.data + a.size) || Same(a, b)) continue;
      return InvalidArgument(
          "d_scene.{} of scene {} ({} numbers) and d_scene.{} of scene {} ({} numbers) overlap: "
          "only whole arrays of the same kind and size may be shared",
          a.name, a.scene, a.size, b.name, b.scene, b.size);
    }
    return {};
  }

 private:
  struct Array {
    const T* data;
    std::size_t size, scene;
    std::string_view name;
    int width;  // of a texture
  };

  static bool Same(const Array& a, const Array& b) {
    return a.data == b.data && a.size == b.size && a.name == b.name && a.width == b.width;
  }
  static bool Before(const Array& a, const Array& b) {
    if (a.data != b.data) return std::less<const T*>()(a.data, b.data);
    return a.scene < b.scene;
  }

  std::vector<Array> arrays_;
};

}  // namespace tilegrad
