// SPDX-License-Identifier: Apache-2.0
#include "scene/shrink_image.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/rng.h"

namespace tilegrad::shrink_image_test {

TEST(ShrunkImage, IsTheMeanOfWhatIsBehind) {
  ImageU8 image(4, 2, 1);
  image.pixels = {10, 20, 1, 1, 30, 40, 1, 3};
  const ImageU8 small = ShrunkImage(image, 2);
  ASSERT_EQ(small.width, 2);
  ASSERT_EQ(small.height, 1);
  EXPECT_EQ(small.pixels, (std::vector<std::uint8_t>{25, 2}));
  EXPECT_EQ(ShrunkImage(image, 4).pixels, image.pixels);
}

std::vector<std::uint8_t> MeansOf(const ImageU8& image, int width, int height) {
  std::vector<std::uint8_t> out;
  for (int y = 0; y < height; ++y) {
    for (int i = 0; i < width * image.channels; ++i) {
      const int x = i / image.channels;
      int sum = 0, count = 0;
      for (int v = y * image.height / height; v < (y + 1) * image.height / height; ++v) {
        for (int u = x * image.width / width; u < (x + 1) * image.width / width; ++u, ++count)
          sum += image.at(u, v)[i % image.channels];
      }
      out.push_back(static_cast<std::uint8_t>((sum + count / 2) / count));
    }
  }
  return out;
}

TEST(ShrunkImage, RoundsTheMeansOfBlocksOfAnySize) {
  Rng rng(3, 0);
  for (int channels = 1; channels <= 4; ++channels) {
    ImageU8 image(61, 47, channels);
    for (std::uint8_t& byte : image.pixels) byte = static_cast<std::uint8_t>(rng.Below(256));
    for (const int side : {60, 31, 20, 7, 2}) {
      const ImageU8 small = ShrunkImage(image, side);
      EXPECT_EQ(small.pixels, MeansOf(image, small.width, small.height)) << channels << " " << side;
    }
    std::fill(image.pixels.begin(), image.pixels.end(), 255);
    EXPECT_EQ(ShrunkImage(image, 9).pixels[0], 255);
  }
}

}  // namespace tilegrad::shrink_image_test
