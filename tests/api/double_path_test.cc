// SPDX-License-Identifier: Apache-2.0
// RendererT<double> is double all the way: no number passes through a float, from any input to any
// image and any gradient.
//
// An output along a line of inputs, at seven places h apart, is a smooth function plus rounding.
// Its sixth difference takes all but h^6 of the former away; of the latter it leaves 64 roundings
// at most. A float on the way is a staircase, of which the line climbs some steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "api/test_scene.h"
#include "api/variants.h"

namespace tilegrad::double_path_test {

using test::TestScene;
using test::Variant;
using test::VariantScene;

constexpr double kStep = 1e-7;  // relative: that of float is 6e-8 to 1.2e-7
constexpr int kPlaces = 7;
constexpr double kSixth[kPlaces] = {1, -6, 15, -20, 15, -6, 1};
// 64 roundings of 1.1e-16, each amplified some hundred times on the way: one division by the height
// of a face on the screen, one by depth, one by the length of a normal.
constexpr double kMostNoise = 2e-12;

// Depth of background counts as 0.
test::NamedNumbers<double> OutputsOf(VariantScene<double>& v) {
  RendererT<double> renderer({.threads = 1});
  FrameT<double> frame;
  auto out = test::NumbersOf(v, std::span<const SceneT<double>>(&v.s.scene, 1), &renderer, &frame);
  for (double& d : out["depth"]) d = std::isfinite(d) ? d : 0;
  return out;
}

class DoublePath : public testing::TestWithParam<Variant> {};

TEST_P(DoublePath, HasNoFloatOnIt) {
  std::vector<std::string> kinds;
  VariantScene<double>(GetParam()).ForEach([&](const char* kind, double&) {
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  });
  for (const std::string& moved : kinds) {
    test::NamedNumbers<double> sum, one;
    for (int k = 0; k < kPlaces; ++k) {
      VariantScene<double> v(GetParam());
      test::Numbers numbers;
      v.ForEach([&](const std::string& kind, double& x) {
        const double along = numbers.Next();
        const double step = kStep * (along + (along < 0 ? -0.5 : 0.5)) * std::max(1.0, std::abs(x));
        // Not around x: float may hold x, and a staircase that is odd there has no sixth
        // difference.
        if (kind == moved) x += (k + 1) * step;
      });
      one = OutputsOf(v);
      for (const auto& [name, values] : one) {
        sum[name].resize(values.size());
        for (std::size_t i = 0; i < values.size(); ++i) sum[name][i] += kSixth[k] * values[i];
      }
    }
    // Beside the largest of its array: of a sum over pixels what is left may be small.
    for (const auto& [name, values] : one) {
      double most = 0, noise = 0;
      for (const double x : values) most = std::max(most, std::abs(x));
      for (const double x : sum[name]) noise = std::max(noise, std::abs(x));
      EXPECT_LE(noise, kMostNoise * most) << moved << " to " << name;
    }
  }
}

// What differences do not show: constants. The weights of texels in a level of a pyramid sum to 1,
// thirds and sevenths, too, so what is of one colour stays that, up to a rounding for each level.
TEST(DoubleConstants, APyramidOfOneColourIsThatColour) {
  TestScene<double> s(Lighting::kNone);
  std::fill(s.texels.begin(), s.texels.end(), 0.3);
  s.texels.resize(7 * 5 * 3, 0.3);
  s.textures[0] = {s.texels, 7, 5, Wrap::kRepeat, Filter::kTrilinear};
  for (double& uv : s.uvs) uv *= 6;
  s.scene.colors = {};
  RendererT<double> renderer;
  FrameT<double> frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, test::kTestOptions, {}, &frame).ok());
  const ImagesT<double>& i = frame.images();
  for (std::size_t p = 0; p < i.color.size(); ++p) {
    const bool background = i.face_ids[p % i.face_ids.size()] < 0;
    EXPECT_NEAR(i.color[p], background ? 0 : 0.3, 1e-15);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DoublePath, testing::ValuesIn(test::kVariants),
                         [](const auto& p) { return p.param.name; });

}  // namespace tilegrad::double_path_test
