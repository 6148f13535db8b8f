// SPDX-License-Identifier: Apache-2.0
#include "shade/texture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/texture.cc"
#include <hwy/foreach_target.h>

#include "shade/texture-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(SampleRun);
HWY_EXPORT(SampleRunAdjoint);

void SampleTexture(std::size_t count, const TextureInput& input, RunPlane* color) {
  HWY_DYNAMIC_DISPATCH(SampleRun)(count, input, color);
}

void SampleTextureAdjoint(std::size_t count, const TextureInput& input, const RunPlane* d_color,
                          RunPlane* d_uv, TexelShare* shares) {
  HWY_DYNAMIC_DISPATCH(SampleRunAdjoint)(count, input, d_color, d_uv, shares);
}

}  // namespace tilegrad::shade
#endif
