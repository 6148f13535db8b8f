// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/face_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/nvdiffrast/face_steps.cc"
#include <hwy/foreach_target.h>

#include "compat/nvdiffrast/face_steps-inl.h"

#if HWY_ONCE

namespace tilegrad::compat::nvdiffrast {
HWY_EXPORT(ReadRow);
HWY_EXPORT(FindRowSteps);

std::size_t ReadFaceRow(std::span<const float> rast, std::size_t faces, FaceRow* out) {
  return HWY_DYNAMIC_DISPATCH(ReadRow)(rast, faces, out);
}

void FindSteps(const FaceRow& row, const FaceRow& above, std::size_t width,
               std::span<std::uint64_t> steps) {
  HWY_DYNAMIC_DISPATCH(FindRowSteps)(row, above, width, steps);
}

}  // namespace tilegrad::compat::nvdiffrast
#endif
