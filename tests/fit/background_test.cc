// SPDX-License-Identifier: Apache-2.0
#include "fit/background.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/rng.h"
#include "fit/input.h"
#include "fit/masks/start_masks.h"
#include "fit/views_fixture.h"
#include "io/image_file.h"

namespace tilegrad::train::background_test {

constexpr int kSide = 96;
constexpr std::size_t kPixels = std::size_t{kSide} * kSide;

// A ring around the middle.
bool OnRing(int x, int y) {
  const double r = std::hypot(x + 0.5 - kSide / 2.0, y + 0.5 - kSide / 2.0);
  return r > 12 && r < 30;
}

// Red ring before a wall that gets darker to the right, with noise.
std::vector<float> Ring(double noise, double texture = 0) {
  Rng rng(5);
  std::vector<float> out(3 * kPixels);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::size_t c = i / kPixels, p = i % kPixels;
    const int x = static_cast<int>(p) % kSide, y = static_cast<int>(p) / kSide;
    const double wall = 0.85 - 0.25 * x / kSide + texture * ((x / 4 + y / 4) % 2);
    const double object = c == 0 ? 0.7 : 0.2;
    out[i] = static_cast<float>((OnRing(x, y) ? object : wall) + noise * rng.Normal());
  }
  return out;
}

std::vector<float> RingMask() {
  std::vector<float> out(kPixels);
  for (std::size_t p = 0; p < kPixels; ++p)
    out[p] = OnRing(static_cast<int>(p) % kSide, static_cast<int>(p) / kSide) ? 1.0f : 0.0f;
  return out;
}

TEST(Background, LeavesTheObjectWithItsHole) {
  for (const double noise : {0.0, 0.02, 0.04}) {
    const BackgroundMask mask = MaskFromPlainBackground(Ring(noise), kSide, kSide);
    EXPECT_GT(MaskIou(mask.alpha, RingMask()), 0.95) << noise;
    EXPECT_EQ(mask.doubt, "") << noise;
  }
}

TEST(Background, AnObjectMayHaveItsColourInside) {
  std::vector<float> color = Ring(0);
  // A speck of the wall's colour, 2 x 2 pixels: below 0.05 % of the picture.
  for (std::size_t c = 0; c < 3; ++c) {
    for (const int x : {69, 70}) {
      for (const int y : {47, 48}) {
        color[c * kPixels + static_cast<std::size_t>(y * kSide + x)] =
            static_cast<float>(0.85 - 0.25 * x / kSide);
      }
    }
  }
  const BackgroundMask mask = MaskFromPlainBackground(color, kSide, kSide);
  EXPECT_EQ(mask.alpha[48 * kSide + 69], 1);
}

TEST(Background, DropsSpecks) {
  std::vector<float> color = Ring(0);
  for (std::size_t c = 0; c < 3; ++c) color[c * kPixels + 8 * kSide + 80] = 0;
  const BackgroundMask mask = MaskFromPlainBackground(color, kSide, kSide);
  EXPECT_EQ(mask.alpha[8 * kSide + 80], 0);
}

TEST(Background, SaysWhenItIsNotPlain) {
  const auto doubt = [](const std::vector<float>& color) {
    return MaskFromPlainBackground(color, kSide, kSide).doubt;
  };
  ExpectIn(doubt(Ring(0, 0.4)), "not plain");
  ExpectIn(doubt(std::vector<float>(3 * kPixels, 0.5f)), "no foreground");
  // A foot on the lower edge is no reason to doubt.
  std::vector<float> foot = Ring(0);
  for (std::size_t y = 70; y < kSide; ++y) {
    for (std::size_t x = 40; x < 56; ++x)
      foot[y * kSide + x] = foot[kPixels + y * kSide + x] = 0.1f;
  }
  EXPECT_EQ(doubt(foot), "");
}

// Renders before a grey wall with noise, as files.
class BackgroundInput : public ViewsTest {
 protected:
  void SetUp() override {
    truth_ = Views(ColoredBox(), {.views = 4, .held_out = 0, .size = 64}).images.alpha;
    Rng rng(3);
    for (int i = 0; i < 4; ++i) PutBeforeWall(i, &rng);
    found_ = Ok(ReadFitFolder(folder_ / "views", InputOptions{})).value();
  }
  void PutBeforeWall(int i, Rng* rng) const {
    const Path file = folder_ / "views" / "images" / (std::string("00") + char('0' + i) + ".png");
    const auto image = Ok(io::LoadImage(file));
    ImageU8 photo(64, 64, 3);
    for (std::size_t p = 0; p < 64 * 64; ++p) {
      const double alpha = image->pixels[4 * p + 3] / 255.0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double value =
            alpha * image->pixels[4 * p + c] + (1 - alpha) * 205 + 5 * rng->Normal();
        photo.pixels[3 * p + c] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
    ASSERT_TRUE(io::SavePng(file, photo).ok());
  }

  AlignedVector<float> truth_;  // alpha of the renders
  FitInput found_;
};

TEST_F(BackgroundInput, RendersWithNoiseGetTheirMasks) {
  EXPECT_TRUE(found_.masked);
  EXPECT_TRUE(found_.warnings.empty());
  EXPECT_GT(MaskIou(found_.images.alpha, truth_), 0.96);
  for (const Background other : {Background::kMask, Background::kNone}) {
    const auto bare = Ok(ReadFitFolder(folder_ / "views", {.background = other}));
    EXPECT_FALSE(bare->masked);
  }
}

// Where people can correct them; a fit reads them back.
TEST_F(BackgroundInput, MasksAreKept) {
  FitJob job;
  job.input = found_;
  job.out = folder_ / "fit";
  ASSERT_TRUE(StartMasks(false, &job, Workers(1), {}).ok());
  FitInput again = found_;
  ASSERT_TRUE(ReadMasks(job.out / "masks", &again).ok());
  for (std::size_t p = 0; p < again.images.alpha.size(); ++p)
    EXPECT_NEAR(again.images.alpha[p], found_.images.alpha[p], 0.5 / 255 + 1e-6);
  ExpectOnly(found_.notes, "0 of 4 are in doubt");
}

TEST_F(BackgroundInput, NeedsNoCameras) {
  std::filesystem::remove(folder_ / "views" / "transforms_train.json");
  const auto lone = Ok(ReadFitFolder(folder_ / "views", {.fov = 90}));
  EXPECT_FALSE(lone->posed);
  EXPECT_EQ(lone->cameras.size(), 4u);
  EXPECT_NEAR(lone->cameras[0].fx, 32, 1e-4);
}

}  // namespace tilegrad::train::background_test
