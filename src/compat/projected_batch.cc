// SPDX-License-Identifier: Apache-2.0
#include "compat/projected_batch.h"

#include <limits>

#include "base/array_checks.h"
#include "base/error.h"
#include "render/validate.h"

namespace tilegrad::compat {
namespace {

Status CheckFaceIds(std::span<const std::int32_t> ids, std::size_t faces) {
  const auto end = static_cast<std::int32_t>(faces);
  if (AllWithin(ids, -1, end)) return {};
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < -1 || ids[i] >= end) {
      return InvalidArgument("face_idx[{}] is {}, outside of [-1, {})", i, ids[i], faces);
    }
  }
  return {};
}

}  // namespace

template <class T>
Status ValidateProjected(const ProjectedBatchT<T>& batch, const ImageSize& size,
                         std::span<const std::int32_t> face_ids) {
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max() / 3;
  TILEGRAD_TRY(CheckImageSize("width", size.width));
  TILEGRAD_TRY(CheckImageSize("height", size.height));
  if (batch.faces > kMost) {
    return InvalidArgument("{} faces per image; the limit is {}", batch.faces, kMost);
  }
  const std::size_t faces = batch.images * batch.faces;
  TILEGRAD_TRY(CheckSize("face_vertices_image", batch.xy.size(), 6 * faces));
  if (!batch.z.empty()) TILEGRAD_TRY(CheckSize("face_vertices_z", batch.z.size(), 3 * faces));
  if (!batch.valid.empty()) TILEGRAD_TRY(CheckSize("valid_faces", batch.valid.size(), faces));
  TILEGRAD_TRY(CheckFinite("face_vertices_image", batch.xy));
  if (face_ids.empty()) return {};
  TILEGRAD_TRY(CheckSize("face_idx", face_ids.size(), batch.images * PixelCount(size)));
  return CheckFaceIds(face_ids, batch.faces);
}

TILEGRAD_INSTANTIATE(ValidateProjected);

}  // namespace tilegrad::compat
