// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/texture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/nvdiffrast/texture.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "compat/nvdiffrast/texture-inl.h"

#if HWY_ONCE

#include <algorithm>
#include <vector>

#include "compat/nvdiffrast/texture_ref.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

HWY_EXPORT(SampleBand);
HWY_EXPORT(PullCoordinatesOfBand);
HWY_EXPORT(PullTexelsOfBand);

constexpr std::size_t kFillGrain = std::size_t{1} << 16;

// Every task visits all pixels and sums the texels of its part: each texel in pixel order, whatever
// the number of tasks.
void PullTexels(const TextureInput<float>& input, std::span<const float> d_out,
                const Workers& workers, std::span<const std::span<float>> d_levels) {
  for (const std::span<float> level : d_levels) {
    workers.ForRanges(level.size(), kFillGrain,
                      [&](std::size_t begin, std::size_t end, std::size_t) {
                        std::fill(level.begin() + static_cast<std::ptrdiff_t>(begin),
                                  level.begin() + static_cast<std::ptrdiff_t>(end), 0.0f);
                      });
  }
  const auto parts = static_cast<std::size_t>(workers.count());
  workers.For(parts, [&](std::size_t part, std::size_t) {
    std::vector<float*> at(d_levels.size());
    for (std::size_t b = 0; b < input.grid.bands(); ++b) {
      const Band band = input.grid.band(b);
      for (std::size_t l = 0; l < at.size(); ++l) {
        at[l] = d_levels[l].data() + texture_ref::FirstTexel(input, l, band.image) * input.channels;
      }
      HWY_DYNAMIC_DISPATCH(PullTexelsOfBand)
      (input, band, d_out, {static_cast<std::uint32_t>(part), static_cast<std::uint32_t>(parts)},
       at.data());
    }
  });
}

}  // namespace

template <>
void SampleTexture(const TextureInput<float>& input, const Workers& workers, std::span<float> out) {
  workers.For(input.grid.bands(), [&](std::size_t band, std::size_t) {
    HWY_DYNAMIC_DISPATCH(SampleBand)(input, input.grid.band(band), out);
  });
}

template <>
void SampleTexture(const TextureInput<double>& input, const Workers& workers,
                   std::span<double> out) {
  SampleTextureRef(input, workers, out);
}

template <>
void SampleTextureBackward(const TextureInput<float>& input, std::span<const float> d_out,
                           const Workers& workers, const TextureGradients<float>& out) {
  if (!out.d_levels.empty()) PullTexels(input, d_out, workers, out.d_levels);
  if (input.filter == TextureFilter::kNearest) {  // a step function of the coordinates
    for (const auto& gradient : {out.d_uv, out.d_uv_da, out.d_mip_level_bias}) {
      std::fill(gradient.begin(), gradient.end(), 0.0f);
    }
    return;
  }
  if (out.d_uv.empty() && out.d_uv_da.empty() && out.d_mip_level_bias.empty()) return;
  workers.For(input.grid.bands(), [&](std::size_t band, std::size_t) {
    HWY_DYNAMIC_DISPATCH(PullCoordinatesOfBand)(input, input.grid.band(band), d_out, out);
  });
}

template <>
void SampleTextureBackward(const TextureInput<double>& input, std::span<const double> d_out,
                           const Workers& workers, const TextureGradients<double>& out) {
  SampleTextureBackwardRef(input, d_out, workers, out);
}

}  // namespace tilegrad::compat::nvdiffrast
#endif
