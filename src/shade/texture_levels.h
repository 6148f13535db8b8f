// SPDX-License-Identifier: Apache-2.0
// The mip pyramid of a texture. Each level halves the previous one (rounded down, at least 1) by
// area averaging: along an odd side, a texel covers slightly more than two.
//
// A level along one axis: texel j of n' covers [j n / n', (j + 1) n / n') of n.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "shade/texture.h"

namespace tilegrad::shade {

// Position of a mip level in one array of all levels, finest first.
struct LevelSize {
  int width, height;
  std::size_t first;  // texel
  std::size_t texels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

inline LevelSize NextLevel(const LevelSize& l) {
  return {std::max(1, l.width / 2), std::max(1, l.height / 2), l.first + l.texels()};
}

// Number of levels that a filter needs: one, or all down to one texel.
inline int LevelCount(int width, int height, Filter filter) {
  int count = 1;
  if (filter != Filter::kTrilinear) return count;
  for (; width > 1 || height > 1; ++count) {
    width /= 2;
    height /= 2;
  }
  return count;
}

// The texels of the finer level that a texel covers, along one axis: at most three. Real: float or
// double.
template <class Real>
struct Coverage {
  int first, count;
  Real weight[3];  // sum to 1
};

template <class Real>
Coverage<Real> CoverageOf(int j, int coarse, int fine) {
  if (fine % coarse == 0) {
    const int ratio = fine / coarse;  // merges 1, 2, or 3 texels
    const Real weight = Real(1) / static_cast<Real>(ratio);
    return {j * ratio, ratio, {weight, weight, weight}};
  }
  const auto m = static_cast<Real>(coarse), x = static_cast<Real>(j);
  const Real all = static_cast<Real>(fine) / m;
  return {2 * j, 3, {(1 - x / m) / all, 1 / all, (x + 1) / m / all}};
}

// Texels of all levels in one array, [texel][kChannels]; level 0 is given. The same loop serves
// forward and adjoint: calls visit(coarse texel, fine texel, weight).
template <class Real, class Visit>
void ForEachCovered(const LevelSize& fine, const LevelSize& coarse, const Visit& visit) {
  for (int y = 0; y < coarse.height; ++y) {
    const Coverage<Real> rows = CoverageOf<Real>(y, coarse.height, fine.height);
    for (int x = 0; x < coarse.width; ++x) {
      const Coverage<Real> columns = CoverageOf<Real>(x, coarse.width, fine.width);
      const auto to = coarse.first + static_cast<std::size_t>(y * coarse.width + x);
      for (int r = 0; r < rows.count; ++r) {
        for (int c = 0; c < columns.count; ++c) {
          const auto from = fine.first + static_cast<std::size_t>((rows.first + r) * fine.width +
                                                                  columns.first + c);
          // NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult): counts are up to 3
          visit(to, from, rows.weight[r] * columns.weight[c]);
        }
      }
    }
  }
}

// A texture prepared for SampleTexture. Reuses its memory.
class TexturePyramid {
 public:
  // Copies the texels and builds the levels that the filter needs.
  void Build(const TextureView& texture);
  std::span<const TextureLevel> levels() const { return levels_; }
  std::span<const LevelSize> sizes() const { return sizes_; }
  const TextureView& view() const { return view_; }

 private:
  TextureView view_;
  std::vector<LevelSize> sizes_;
  std::vector<TextureLevel> levels_;
  AlignedVector<float> texels_;  // [texel][4]
};

// Part `index` of `count` parts of the rows of every level.
struct RowShare {
  int index, count;
};

// The gradient of a texture. Reuses its memory.
class TextureGradient {
 public:
  void Clear(const TexturePyramid& pyramid);
  // Adds shares to the texels of some rows: different parts may run in parallel.
  void Scatter(std::span<const TexelShare> shares, const RowShare& rows);
  // out [height][width][3] <- the gradient of all levels, propagated to the finest.
  void Finish(std::span<float> out);

 private:
  std::vector<LevelSize> sizes_;
  AlignedVector<float> d_texels_;  // [texel][4]
};

}  // namespace tilegrad::shade
