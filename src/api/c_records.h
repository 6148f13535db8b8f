// SPDX-License-Identifier: Apache-2.0
// Converts the structs of tilegrad/c.h to the records of the C++ interface.
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

// struct_size of a struct or of the first of an array; `from` may be unaligned.
inline std::size_t StructSize(const void* from) {
  std::size_t size;
  std::memcpy(&size, from, sizeof size);
  return size;
}
Status CheckStructSize(const char* name, std::size_t size);

// Reads a caller's struct, which may be of an older or newer version: `to` keeps its defaults
// beyond the end of an older one. A newer one must have zeros in all members that we do not know.
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

// Reads entry n of an array of structs of the caller's size; read entries in order.
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

// Rejects counts that were negative before conversion to size_t.
Status CheckCount(const char* name, std::size_t count);
// A NULL array has no entries: a count > 0 means that the caller forgot the pointer, and attributes
// without `channels` that the caller forgot these.
Status CheckCounts(const tilegrad_scene& scene);
// An error for a gradient of an array that the scene does not have: it would be left unwritten.
Status CheckRequested(const tilegrad_scene_gradients& wanted, const Scene& scene);

// A scene, and the lists that it views.
struct CScene {
  std::vector<Texture> textures;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  Scene scene;

  void Set(const tilegrad_scene& from);
};

// The gradients of a scene, and the lists that they view.
struct CGradients {
  std::vector<std::span<float>> textures;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  Camera camera;
  SceneGradients gradients;

  void Set(const tilegrad_scene_gradients& from, const Scene& scene);
  // Zeroes what is not a plain array.
  static void Clear(const tilegrad_scene_gradients& to, const Scene& scene);
  // False if a sum is not finite.
  bool AddTo(const tilegrad_scene_gradients& to) const;
};

RenderOptions OptionsOf(const tilegrad_options& from);
Outputs OutputsOf(const tilegrad_options& from);
tilegrad_camera CameraOf(const Camera& from);
FrameGradients FrameGradientsOf(const tilegrad_frame_gradients& from, const Images& images);
tilegrad_images ImagesOf(const Images& from);

}  // namespace tilegrad::api
