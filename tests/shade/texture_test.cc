// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "base/rng.h"
#include "shade/texture_levels.h"
#include "shade/texture_levels_ref.h"
#include "shade/texture_ref.h"
#include "shade/vec3_ref.h"
#include "support/expect.h"

namespace tilegrad::shade::texture_test {

constexpr int kWidth = 5, kHeight = 4, kChannels = 3;

template <class T>
TextureViewT<T> View(const std::vector<T>& texels, Wrap wrap) {
  return {texels, kWidth, kHeight, kChannels, wrap};
}

std::vector<double> RandomTexels() {
  Rng rng(7);
  std::vector<double> out(kWidth * kHeight * kChannels);
  for (double& t : out) t = rng.Uniform();
  return out;
}

template <class T>
std::vector<T> Sample(const TextureViewT<T>& texture, T u, T v) {
  std::vector<T> color(static_cast<std::size_t>(texture.channels));
  SampleLevelRef<T>(texture, u, v, color);
  return color;
}

constexpr Wrap kWays[] = {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror};

// Nine ways, each along its own axis: what it makes of u is what it makes of u alone.
TEST(Texture, EachAxisWrapsInItsOwnWay) {
  EXPECT_EQ(WrapOf(Wrap::kRepeat, Wrap::kClamp), Wrap::kRepeatClamp);
  EXPECT_EQ(WrapOf(Wrap::kMirror, Wrap::kRepeat), Wrap::kMirrorRepeat);
  EXPECT_EQ(WrapOf(Wrap::kClamp, Wrap::kClamp), Wrap::kClamp);
  const auto texels = RandomTexels();
  for (const Wrap u : kWays) {
    for (const Wrap v : kWays) {
      EXPECT_EQ(WrapAlongU(WrapOf(u, v)), u);
      EXPECT_EQ(WrapAlongV(WrapOf(u, v)), v);
      const auto both = View(texels, WrapOf(u, v));
      // Within half a texel of the middle no wrap matters to the other axis.
      EXPECT_EQ(Sample(both, -1.2, 0.5), Sample(View(texels, u), -1.2, 0.5));
      EXPECT_EQ(Sample(both, 0.5, 2.7), Sample(View(texels, v), 0.5, 2.7));
    }
  }
}

TEST(Texture, RepeatTilesThePlaneAndClampHoldsTheBorder) {
  const auto texels = RandomTexels();
  const auto repeat = View(texels, Wrap::kRepeat), clamp = View(texels, Wrap::kClamp);
  const auto inside = Sample(repeat, 0.3, 0.6), outside = Sample(repeat, 3.3, -1.4);
  const auto edge = Sample(clamp, 0.0, 1.0), far = Sample(clamp, -9.0, 4.0);
  for (std::size_t c = 0; c < kChannels; ++c) {
    EXPECT_NEAR(inside[c], outside[c], 1e-14);  // 3.3 * 5 loses 2 bits more than 0.3 * 5
    EXPECT_EQ(edge[c], texels[c]);
    EXPECT_EQ(far[c], texels[c]);
  }
  const auto mirror = View(texels, Wrap::kMirror);  // turns every other tile
  for (const double u : {-0.3, 1.7, 2.3, -3.7}) {
    const auto there = Sample(mirror, u, 0.6);
    for (std::size_t c = 0; c < kChannels; ++c) EXPECT_NEAR(there[c], inside[c], 1e-14) << u;
  }
}

TEST(Texture, EndlessCoordinatesReadATexelNotTheMemoryBeside) {
  const auto texels = RandomTexels();
  for (double u : {1e300, -1e300, std::numeric_limits<double>::infinity(),
                   std::numeric_limits<double>::quiet_NaN()}) {
    for (Wrap wrap : {Wrap::kRepeat, Wrap::kClamp}) {
      for (double c : Sample(View(texels, wrap), u, 0.5)) {
        EXPECT_GE(c, 0.0);
        EXPECT_LE(c, 1.0);
      }
    }
  }
}

}  // namespace tilegrad::shade::texture_test

// Pyramids and wraps by what must hold of them, on every instruction set.

namespace tilegrad::shade::texture_levels_test {

std::vector<float> RandomTexels(int width, int height) {
  Rng rng(static_cast<std::uint64_t>(width * 100 + height), 1);
  std::vector<float> out(static_cast<std::size_t>(3 * width * height));
  for (float& t : out) t = static_cast<float>(rng.Uniform());
  return out;
}

double Mean(const TextureLevel& level) {
  double sum = 0;
  for (int i = 0; i < level.width * level.height; ++i) {
    sum += static_cast<double>(level.texels[4 * i]);
  }
  return sum / (level.width * level.height);
}

TEST(TextureLevels, EachHalvesTheOneBeforeAndKeepsItsMean) {
  for (const auto& [width, height] : {std::pair{16, 8}, {7, 5}, {1, 9}, {13, 2}}) {
    const auto texels = RandomTexels(width, height);
    TexturePyramid pyramid;
    pyramid.Build({texels, width, height, 3, Wrap::kRepeat, Filter::kTrilinear});
    const auto levels = pyramid.levels();
    EXPECT_EQ(levels.back().width * levels.back().height, 1);
    for (std::size_t l = 1; l < levels.size(); ++l) {
      EXPECT_EQ(levels[l].width, std::max(1, levels[l - 1].width / 2));
      EXPECT_EQ(levels[l].height, std::max(1, levels[l - 1].height / 2));
      EXPECT_NEAR(Mean(levels[l]), Mean(levels[0]), 1e-6) << width << " x " << height;
    }
  }
}

// A gradient of 1 at each texel of a level: the finest level gets as much in all.
TEST(TextureLevels, GradientsOfAllLevelsArriveAtTheFinest) {
  const auto texels = RandomTexels(7, 5);
  TexturePyramid pyramid;
  pyramid.Build({texels, 7, 5, 3, Wrap::kRepeat, Filter::kTrilinear});
  TextureGradient gradient;
  gradient.Clear(pyramid);
  std::vector<TexelShare> shares;
  for (std::uint32_t l = 0; l < pyramid.sizes().size(); ++l) {
    shares.push_back({0, 0, 0, 0, 0.25f, 0.5f, {1, 2, 3}, l});
  }
  for (const int part : {0, 1}) gradient.Scatter(shares, {part, 2});
  std::vector<float> out(texels.size());
  gradient.Finish(out);
  double sum = 0;
  for (std::size_t i = 0; i < out.size(); i += 3) sum += static_cast<double>(out[i]);
  EXPECT_NEAR(sum, static_cast<double>(shares.size()), 1e-5);
}

// Lookups of one coordinate at a given level.
Vec3<float> Sample(const TexturePyramid& pyramid, float u, float v, float level) {
  RunPlane uv[2], levels, color[3];
  std::fill_n(uv[0].at, kRunPad, u);
  std::fill_n(uv[1].at, kRunPad, v);
  std::fill_n(levels.at, kRunPad, level);
  const TextureView& view = pyramid.view();
  SampleTexture(1, {pyramid.levels(), view.wrap, view.filter, uv, &levels}, color);
  return {color[0].at[0], color[1].at[0], color[2].at[0]};
}

TEST(TextureLevels, LookupsOnEveryTargetAreThoseOfTheReference) {
  constexpr int kWidth = 7, kHeight = 5;
  const auto texels = RandomTexels(kWidth, kHeight);
  for (const std::string target : EveryTarget()) {
    Rng rng(4, 4);
    for (int n = 0; n < 432; ++n) {
      const auto wrap = static_cast<Wrap>(n / 4 % 9);
      const auto filter = static_cast<Filter>(n / 36 % 3);
      const TextureView view{texels, kWidth, kHeight, 3, wrap, filter};
      TexturePyramid pyramid;
      pyramid.Build(view);
      const auto u = static_cast<float>(rng.Uniform(-3, 3));
      const auto v = static_cast<float>(rng.Uniform(-3, 3));
      const auto level = static_cast<float>(rng.Uniform(-1, 5));
      const auto got = Sample(pyramid, u, v, level);
      const auto expected = SampleRef(PyramidRef<float>(view), u, v, level);
      // Weights err by a few roundings of coordinates of up to 7 texels.
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(got[c], expected[c], 1e-5f);
    }
  }
}

// Between levels a trilinear lookup goes from one to the other without a jump.
TEST(TextureLevels, TrilinearIsContinuousInTheLevel) {
  const auto texels = RandomTexels(16, 16);
  TexturePyramid pyramid;
  pyramid.Build({texels, 16, 16, 3, Wrap::kRepeat, Filter::kTrilinear});
  auto last = Sample(pyramid, 0.37f, 0.61f, -1);
  for (float level = -1; level < 6; level += 0.01f) {
    const auto now = Sample(pyramid, 0.37f, 0.61f, level);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(now[c], last[c], 0.0101f) << level;
    last = now;
  }
}

}  // namespace tilegrad::shade::texture_levels_test
