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

namespace tilegrad::api {

// Of a struct or an array of structs, which may stand anywhere.
inline std::size_t StructSize(const void* from) {
  std::size_t size;
  std::memcpy(&size, from, sizeof size);
  return size;
}
Status CheckStructSize(const char* name, std::size_t size);

// A struct of the caller, whose size may be that of an older or a newer version: `to` keeps its
// defaults where the caller's ends. A newer one may not say anything that we do not know.
template <class S>
Status ReadSized(const char* name, const S* from, S* to) {
  if (from == nullptr) return InvalidArgument("{} is NULL", name);
  const std::size_t size = StructSize(from);
  TILEGRAD_TRY(CheckStructSize(name, size));
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

// Entry n, all before which were read, of an array of structs of the caller's size.
template <class S>
Status ReadEntry(const char* name, const S* array, std::size_t n, S* to) {
  if (array == nullptr) return InvalidArgument("{} is NULL", name);
  const std::size_t size = StructSize(array);
  const auto* entry = reinterpret_cast<const S*>(reinterpret_cast<const char*>(array) + n * size);
  if (n > 0 && StructSize(entry) != size) {
    return InvalidArgument("{}.struct_size is {}, that of the first is {}", name, StructSize(entry),
                           size);
  }
  return ReadSized(name, entry, to);
}

// A negative number that became a size is none.
Status CheckCount(const char* name, std::size_t count);
// An array that is NULL has no entries: a count says otherwise where a pointer was forgotten.
Status CheckCounts(const tilegrad_scene& scene);
// A gradient of an array that the scene does not have would be left as it is.
Status CheckRequested(const tilegrad_scene_gradients& wanted, const Scene& scene);

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

}  // namespace tilegrad::api
