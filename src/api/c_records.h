// SPDX-License-Identifier: Apache-2.0
// From the structs of tilegrad/c.h to the records of the C++ interface.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "base/error.h"
#include "tilegrad/c.h"
#include "tilegrad/tilegrad.h"

namespace tilegrad::v0 {

// A struct of the caller, whose size may be that of an older or a newer version: `to` keeps its
// defaults where the caller's ends. A newer one may not say anything that we do not know.
template <class S>
Status ReadSized(const char* name, const S* from, S* to) {
  if (from == nullptr) return InvalidArgument("{} is NULL", name);
  const std::size_t size = from->struct_size;
  constexpr std::size_t kMost = 65536;
  if (size < sizeof(std::size_t) || size > kMost) {
    return InvalidArgument("{}.struct_size is {}: tilegrad_..._init comes first", name, size);
  }
  const auto* bytes = reinterpret_cast<const char*>(from);
  for (std::size_t i = sizeof(S); i < size; ++i) {
    if (bytes[i] != 0) {
      return InvalidArgument("{} has members that this library ({}) does not know", name,
                             TILEGRAD_VERSION);
    }
  }
  std::memcpy(to, from, std::min(size, sizeof(S)));
  return {};
}

// Entry n of an array of structs of the caller's size.
template <class S>
const S* EntryOf(const S* array, std::size_t n) {
  if (array == nullptr) return nullptr;
  return reinterpret_cast<const S*>(reinterpret_cast<const char*>(array) + n * array->struct_size);
}

// An array that is NULL has no entries: a count says otherwise where a pointer was forgotten.
Status CheckCounts(const tilegrad_scene& scene);
// A gradient of an array that the scene does not have would be left as it is.
Status CheckWanted(const tilegrad_scene_gradients& wanted, const Scene& scene);

// A scene, and the lists that it looks at.
struct CScene {
  std::vector<Texture> textures;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  Scene scene;

  void Set(const tilegrad_scene& from);
};

// The gradients of a scene, and the lists that they look at.
struct CGradients {
  std::vector<std::span<float>> textures;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  Camera camera;
  SceneGradients gradients;

  void Set(const tilegrad_scene_gradients& from, const Scene& scene);
  // What is not a plain array.
  static void Clear(const tilegrad_scene_gradients& to, const Scene& scene);
  void AddTo(const tilegrad_scene_gradients& to) const;
};

RenderOptions OptionsOf(const tilegrad_options& from);
Outputs OutputsOf(const tilegrad_options& from);
tilegrad_camera CameraOf(const Camera& from);
FrameGradients FrameGradientsOf(const tilegrad_frame_gradients& from, const Images& images);
tilegrad_images ImagesOf(const Images& from);

}  // namespace tilegrad::v0
