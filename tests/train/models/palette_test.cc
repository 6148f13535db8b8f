// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "nn/nn.h"
#include "train/models/texture_painter.h"

namespace tilegrad::train::palette_test {

constexpr std::int64_t kSide = 8, kTexels = kSide * kSide;

// Texels of the left half are of one paint, those of the right half of another; of each half
// nothing but the upper rows is lit, by light of a half.
class Palette : public testing::Test {
 protected:
  Palette() : kinds_(2 * kTexels), seen_(12 * kTexels), guess_(3 * kTexels, 0.9f) {
    for (std::int64_t t = 0; t < kTexels; ++t) {
      const bool right = t % kSide >= kSide / 2, lit = t / kSide < 3;
      kinds_[static_cast<std::size_t>(right ? kTexels + t : t)] = 1;
      const float values[6] = {right ? 0.1f : 0.3f, 0.2f, right ? 0.4f : 0.05f, 1, 1, 0.693147f};
      for (std::int64_t c = 0; c < 6; ++c)
        seen_[static_cast<std::size_t>(c * kTexels + t)] = c < 3 && !lit ? 0 : values[c];
    }
  }
  nn::Tensor Colors() {
    const auto map = [&](std::int64_t channels, const std::vector<float>& numbers) {
      return context_.From({1, channels, kSide, kSide}, std::span<const float>(numbers));
    };
    return PaletteColors(nn::Constant(context_, map(2, kinds_)), map(12, seen_),
                         nn::Constant(context_, map(3, guess_)))
        .value();
  }

  Workers workers_{1};
  nn::Context context_{workers_};
  std::vector<float> kinds_, seen_, guess_;
};

// 12 lit texels of weight 1 / 2 beside one guess: (6 * color + 0.9) / 7.
TEST_F(Palette, PaintsTheDarkLikeTheLit) {
  const nn::Tensor colors = Colors();
  const std::int64_t dark_left = 7 * kSide + 1, dark_right = 7 * kSide + 6;
  const auto at = [&](std::int64_t c, std::int64_t t) {
    return colors.data<float>()[c * kTexels + t];
  };
  EXPECT_NEAR(at(0, dark_left), (6 * 0.6 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(2, dark_left), (6 * 0.1 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(0, dark_right), (6 * 0.2 + 0.9) / 7, 1e-3);
  EXPECT_NEAR(at(2, dark_right), (6 * 0.8 + 0.9) / 7, 1e-3);
}

TEST_F(Palette, GuessesWhereNothingIsLit) {
  std::fill(seen_.begin(), seen_.begin() + 3 * kTexels, 0.0f);
  const nn::Tensor colors = Colors();
  for (const float x : colors.span<float>()) EXPECT_NEAR(x, 0.9, 1e-3);
}

}  // namespace tilegrad::train::palette_test
