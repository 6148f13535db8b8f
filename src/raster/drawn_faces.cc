// SPDX-License-Identifier: Apache-2.0
#include "raster/drawn_faces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/drawn_faces.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/drawn_faces-inl.h"

#if HWY_ONCE
namespace tilegrad::raster {
namespace {

HWY_EXPORT(SetUpFaces);

}  // namespace

void SetUpDrawnFaces(const ScreenMesh& mesh, bool cull_back, std::span<std::uint8_t> reject,
                     DrawnFaces* out) {
  if (out != nullptr && out->storage.size() < mesh.faces()) out->storage.resize(mesh.faces());
  DrawnFace* to = out == nullptr ? nullptr : out->storage.data();
  const std::size_t count = HWY_DYNAMIC_DISPATCH(SetUpFaces)(mesh, cull_back, reject.data(), to);
  if (out != nullptr) out->count = count;
}

}  // namespace tilegrad::raster
#endif
