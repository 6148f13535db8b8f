// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/clip_mesh.h"

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

Status NoSuchFace(std::size_t pixel, double id, std::size_t faces) {
  return InvalidArgument(
      "pixel {} of rast names triangle {} (channel 3), but must name 0 (none) to {}", pixel, id,
      faces);
}

template <class T>
Status CheckFaceIds(std::span<const T> rast, std::size_t faces) {
  for (std::size_t i = 3; i < rast.size(); i += 4) {
    if (!IsFaceId(rast[i], faces)) return NoSuchFace(i / 4, static_cast<double>(rast[i]), faces);
  }
  return {};
}
template Status CheckFaceIds(std::span<const float>, std::size_t);
template Status CheckFaceIds(std::span<const double>, std::size_t);

}  // namespace tilegrad::compat::nvdiffrast
