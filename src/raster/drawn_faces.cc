// SPDX-License-Identifier: Apache-2.0
#include "raster/drawn_faces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/drawn_faces.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/drawn_faces-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "base/parallel.h"

namespace tilegrad::raster {
namespace {

HWY_EXPORT(SetUpSomeFaces);

// Pads lanes without a face.
void FillUp(std::size_t faces, CornerPackets* corners) {
  for (std::size_t packet = faces / kPacketFaces; packet < corners->packets(); ++packet) {
    const std::size_t from = packet == faces / kPacketFaces ? faces % kPacketFaces : 0;
    for (std::size_t number = 0; number < kCornerNumbers; ++number) {
      std::fill(corners->at(packet, number) + from, corners->at(packet, number) + kPacketFaces,
                kNowhere);
    }
  }
}

}  // namespace

void SetUpFaces(const ScreenMesh& mesh, bool cull_back, std::span<std::uint8_t> reject,
                const FaceSetUp& out, const Workers* workers) {
  constexpr std::size_t kChunk = DrawnFaces::kChunk;
  const std::size_t n = mesh.faces();
  if (out.drawn != nullptr) {
    if (out.drawn->storage.size() < n) {
      out.drawn->storage.resize(n);
      out.drawn->bins.resize(n);
    }
    out.drawn->counts.assign((n + kChunk - 1) / kChunk, 0);
  }
  if (out.corners != nullptr) out.corners->Resize(n);
  ForChunks(workers, n, kChunk, [&](std::size_t begin, std::size_t end) {
    FaceList to{nullptr, nullptr};
    if (out.drawn != nullptr) to = {&out.drawn->storage[begin], &out.drawn->bins[begin]};
    const std::size_t count = HWY_DYNAMIC_DISPATCH(SetUpSomeFaces)(mesh, {begin, end, cull_back},
                                                                   reject.data(), out.corners, to);
    if (out.drawn != nullptr) out.drawn->counts[begin / kChunk] = count;
  });
  if (out.corners != nullptr) FillUp(n, out.corners);
}

}  // namespace tilegrad::raster
#endif
