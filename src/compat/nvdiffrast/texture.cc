// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/texture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/nvdiffrast/texture.cc"
#include <hwy/foreach_target.h>

#include "compat/nvdiffrast/texture-inl.h"
#include "compat/nvdiffrast/texture_backward-inl.h"

#if HWY_ONCE

#include <algorithm>

#include "compat/nvdiffrast/texture_ref.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

HWY_EXPORT(SampleBand);
HWY_EXPORT(PullBand);

constexpr std::size_t kFillGrain = std::size_t{1} << 16;

void Clear(std::span<const std::span<float>> d_levels, const Workers& workers) {
  for (const std::span<float> level : d_levels) {
    workers.ForRanges(level.size(), kFillGrain, [&](std::size_t begin, std::size_t end) {
      std::fill(level.begin() + static_cast<std::ptrdiff_t>(begin),
                level.begin() + static_cast<std::ptrdiff_t>(end), 0.0f);
    });
  }
}

// Every task visits all pixels and sums the texels of its part: each texel in pixel order, whatever
// the number of tasks. On the way it computes the coordinates' gradients of its share of bands.
void PullTexels(const TextureInput<float>& input, std::span<const float> d_out,
                const Workers& workers, const TextureGradients<float>& out) {
  Clear(out.d_levels, workers);
  const auto parts = workers.size();
  workers.For(parts, [&](std::size_t part) {
    std::vector<float*> at(out.d_levels.size());
    const TexelPart texels{static_cast<std::uint32_t>(part), static_cast<std::uint32_t>(parts),
                           at.data()};
    for (std::size_t b = 0; b < input.grid.bands(); ++b) {
      const Band band = input.grid.band(b);
      for (std::size_t l = 0; l < at.size(); ++l) {
        at[l] =
            out.d_levels[l].data() + texture_ref::FirstTexel(input, l, band.image) * input.channels;
      }
      const bool own = b % parts == part;
      HWY_DYNAMIC_DISPATCH(PullBand)
      (input, band, d_out, texels, own ? out : TextureGradients<float>());
    }
  });
}

}  // namespace

template <>
void SampleTexture(const TextureInput<float>& input, const Workers& workers, std::span<float> out) {
  workers.For(input.grid.bands(), [&](std::size_t band) {
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
  TextureGradients<float> wanted = out;
  if (input.filter == TextureFilter::kNearest) {  // a step function of the coordinates
    for (const auto& gradient : {out.d_uv, out.d_uv_da, out.d_mip_level_bias}) {
      std::fill(gradient.begin(), gradient.end(), 0.0f);
    }
    wanted = {out.d_levels, {}, {}, {}};
  }
  if (!wanted.d_levels.empty()) return PullTexels(input, d_out, workers, wanted);
  if (!wanted.HasCoordinates()) return;
  workers.For(input.grid.bands(), [&](std::size_t band) {
    HWY_DYNAMIC_DISPATCH(PullBand)(input, input.grid.band(band), d_out, TexelPart(), wanted);
  });
}

template <>
void SampleTextureBackward(const TextureInput<double>& input, std::span<const double> d_out,
                           const Workers& workers, const TextureGradients<double>& out) {
  SampleTextureBackwardRef(input, d_out, workers, out);
}

}  // namespace tilegrad::compat::nvdiffrast
#endif
