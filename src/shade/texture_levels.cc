// SPDX-License-Identifier: Apache-2.0
#include "shade/texture_levels.h"

#include <cstdint>

namespace tilegrad::shade {

void TexturePyramid::Build(const TextureView& texture) {
  view_ = texture;
  sizes_.clear();
  levels_.clear();
  LevelSize size{texture.width, texture.height, 0};
  const int count = LevelCount(texture.width, texture.height, texture.filter);
  for (int l = 0; l < count; ++l, size = NextLevel(size)) sizes_.push_back(size);
  texels_.assign(4 * (sizes_.back().first + sizes_.back().texels()), 0.0f);
  const float* from = texture.texels.data();
  for (std::size_t i = 0; i < sizes_[0].texels(); ++i, from += 3) {
    for (std::size_t c = 0; c < 3; ++c) texels_[4 * i + c] = from[c];
  }
  for (std::size_t l = 0; l < sizes_.size(); ++l) {
    levels_.push_back({texels_.data() + 4 * sizes_[l].first, sizes_[l].width, sizes_[l].height});
    if (l == 0) continue;
    const auto add = [&](std::size_t to, std::size_t source, float weight) {
      for (std::size_t c = 0; c < 4; ++c) texels_[4 * to + c] += weight * texels_[4 * source + c];
    };
    ForEachCovered<float>(sizes_[l - 1], sizes_[l], add);
  }
}

void TextureGradient::Clear(const TexturePyramid& pyramid) {
  sizes_.assign(pyramid.sizes().begin(), pyramid.sizes().end());
  d_texels_.assign(4 * (sizes_.back().first + sizes_.back().texels()), 0.0f);
}

void TextureGradient::Scatter(std::span<const TexelShare> shares, const RowShare& rows) {
  for (const TexelShare& s : shares) {
    const LevelSize& size = sizes_[s.level];
    const auto add = [&](std::uint16_t y, float weight) {
      if (y * rows.count / size.height != rows.index) return;
      const std::size_t first = size.first + static_cast<std::size_t>(y * size.width);
      float* const left = d_texels_.data() + 4 * (first + s.x0);
      float* const right = d_texels_.data() + 4 * (first + s.x1);
      for (std::size_t c = 0; c < 3; ++c) {
        const float d = weight * s.d_color[c];
        left[c] += (1 - s.a) * d;
        right[c] += s.a * d;
      }
    };
    add(s.y0, 1 - s.b);
    add(s.y1, s.b);
  }
}

void TextureGradient::Finish(std::span<float> out) {
  for (std::size_t l = sizes_.size(); l-- > 1;) {
    const auto add = [&](std::size_t to, std::size_t source, float weight) {
      for (std::size_t c = 0; c < 4; ++c) {
        d_texels_[4 * source + c] += weight * d_texels_[4 * to + c];
      }
    };
    ForEachCovered<float>(sizes_[l - 1], sizes_[l], add);
  }
  for (std::size_t i = 0; i < sizes_[0].texels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) out[3 * i + c] = d_texels_[4 * i + c];
  }
}

}  // namespace tilegrad::shade
