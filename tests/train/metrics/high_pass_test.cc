// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/high_pass.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "support/temp_folder.h"

namespace tilegrad::train::high_pass_test {

double Energy(const std::vector<float>& values, int channels, int height, int width,
              const std::vector<std::uint8_t>& covered = {}) {
  return Ok(HighPassEnergy({values, channels, height, width}, covered)).value();
}

TEST(HighPass, ConstantAndSlopeHaveNone) {
  EXPECT_EQ(Energy(std::vector<float>(2 * 20, 0.7f), 2, 4, 5), 0);
  std::vector<float> slope;
  for (int i = 0; i < 25; ++i) slope.push_back(static_cast<float>(i % 5) + 2 * (i / 5));
  EXPECT_NEAR(Energy(slope, 1, 5, 5), 0, 1e-12);
}

// The filter takes a chequerboard out entirely: what is left is the picture itself.
TEST(HighPass, ChequerboardKeepsAll) {
  std::vector<float> board;
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 7; ++x) board.push_back((x + y) % 2 == 0 ? 0.25f : -0.25f);
  }
  EXPECT_NEAR(Energy(board, 1, 6, 7), 0.0625, 1e-12);
}

// One bright pixel: 1 - 4/16 there, -2/16 at its four sides and -1/16 at its four corners.
TEST(HighPass, OnePixelByHand) {
  std::vector<float> image(49, 0.0f);
  image[24] = 1;
  EXPECT_NEAR(Energy(image, 1, 7, 7), (144.0 + 4 * 4 + 4 * 1) / 256 / 25, 1e-12);
}

TEST(HighPass, OutlinesDoNotCount) {
  std::vector<float> image(7 * 7, 0.0f);
  std::vector<std::uint8_t> covered(7 * 7, 0);
  for (int y = 1; y < 6; ++y) {
    for (int x = 1; x < 6; ++x) {
      image[y * 7 + x] = 0.5f;
      covered[y * 7 + x] = 255;
    }
  }
  EXPECT_GT(Energy(image, 1, 7, 7), 0.001);
  EXPECT_EQ(Energy(image, 1, 7, 7, covered), 0);
  covered.assign(49, 0);
  EXPECT_EQ(Energy(image, 1, 7, 7, covered), 0);  // no pixel counts
}

TEST(HighPass, WhatDoesNotFitIsAnError) {
  const std::vector<float> image(12, 0.5f);
  ExpectMessage(HighPassEnergy({image, 1, 3, 5}).status(), "12 values");
  const std::vector<std::uint8_t> covered(11, 1);
  ExpectMessage(HighPassEnergy({image, 1, 3, 4}, covered).status(), "11 marks");
  std::vector<float> broken = image;
  broken[3] = std::numeric_limits<float>::quiet_NaN();
  ExpectMessage(HighPassEnergy({broken, 1, 3, 4}).status(), "not finite");
}

}  // namespace tilegrad::train::high_pass_test
