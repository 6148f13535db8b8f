// SPDX-License-Identifier: Apache-2.0
#include "raster/drawn_faces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/drawn_faces.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/drawn_faces-inl.h"

#if HWY_ONCE
#include "raster/chunks.h"

namespace tilegrad::raster {
namespace {

HWY_EXPORT(SetUpFaces);

}  // namespace

void SetUpDrawnFaces(const ScreenMesh& mesh, bool cull_back, std::span<std::uint8_t> reject,
                     DrawnFaces* out, const Workers* workers) {
  constexpr std::size_t kChunk = DrawnFaces::kChunk;
  const std::size_t n = mesh.faces();
  if (out != nullptr) {
    if (out->storage.size() < n) out->storage.resize(n);
    out->counts.assign((n + kChunk - 1) / kChunk, 0);
  }
  ForChunks(workers, n, kChunk, [&](std::size_t begin, std::size_t end) {
    DrawnFace* to = out == nullptr ? nullptr : out->storage.data() + begin;
    const std::size_t count =
        HWY_DYNAMIC_DISPATCH(SetUpFaces)(mesh, begin, end, cull_back, reject.data(), to);
    if (out != nullptr) out->counts[begin / kChunk] = count;
  });
}

}  // namespace tilegrad::raster
#endif
