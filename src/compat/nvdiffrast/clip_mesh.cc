// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/clip_mesh.h"

#include <cmath>

#include "base/error.h"

namespace tilegrad::compat::nvdiffrast {

Status CheckFaces(FaceList faces, std::size_t vertices) {
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] >= 0 && static_cast<std::size_t>(faces[i]) < vertices) continue;
    return InvalidArgument("face {} has vertex {}, but there are {} vertices", i / 3, faces[i],
                           vertices);
  }
  return {};
}

template <class T>
Status CheckFaceIds(std::span<const T> rast, std::size_t faces) {
  for (std::size_t i = 3; i < rast.size(); i += 4) {
    if (rast[i] >= T(0) && rast[i] <= static_cast<T>(faces) && rast[i] == std::floor(rast[i])) {
      continue;
    }
    return InvalidArgument(
        "pixel {} of rast names triangle {} (channel 3), but must name 0 (none) to {}", i / 4,
        rast[i], faces);
  }
  return {};
}
template Status CheckFaceIds(std::span<const float>, std::size_t);
template Status CheckFaceIds(std::span<const double>, std::size_t);

}  // namespace tilegrad::compat::nvdiffrast
