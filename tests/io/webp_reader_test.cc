// SPDX-License-Identifier: Apache-2.0
// WebP files of libwebp's own encoder.
#include "io/webp_reader.h"

#include <gtest/gtest.h>
#include <webp/encode.h>

#include "io/image_file.h"
#include "io/webp_animation.h"
#include "support/temp_folder.h"

namespace tilegrad::io::webp_reader_test {

ImageU8 Picture(int channels) {
  ImageU8 image(5, 3, channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(40 + 13 * i);
  return image;
}

Bytes Encoded(const ImageU8& image) {
  std::uint8_t* out = nullptr;
  const auto encode = image.channels == 4 ? WebPEncodeLosslessRGBA : WebPEncodeLosslessRGB;
  const std::size_t size =
      encode(image.pixels.data(), image.width, image.height, image.width * image.channels, &out);
  const Bytes bytes(out, out + size);
  WebPFree(out);
  return bytes;
}

using WebpReader = TempFolderTest;

TEST_F(WebpReader, ReadsLosslessPixels) {
  for (const int channels : {3, 4}) {
    const ImageU8 image = Picture(channels);
    const auto back = LoadImage(Write("a.webp", Encoded(image)));
    ASSERT_TRUE(back.ok()) << back.status().message();
    EXPECT_EQ(back->width, 5);
    EXPECT_EQ(back->height, 3);
    EXPECT_EQ(back->channels, channels);
    EXPECT_EQ(back->pixels, image.pixels);
  }
}

// A picture in a container with an Exif chunk that says: turn a quarter.
TEST_F(WebpReader, IsTurnedAsItsTagSays) {
  const Bytes plain = Encoded(Picture(3));
  Bytes file = {'R', 'I', 'F', 'F', 0, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8', 'X'};
  file.insert(file.end(), {10, 0, 0, 0, 8, 0, 0, 0, 4, 0, 0, 2, 0, 0});  // Exif; 5 x 3 pixels
  file.insert(file.end(), plain.begin() + 12, plain.end());
  file.insert(file.end(), {'E', 'X', 'I', 'F', 26, 0, 0, 0});
  file.insert(file.end(), {'I', 'I', 42, 0, 8, 0, 0, 0, 1, 0, 18, 1, 3, 0, 1, 0, 0, 0, 6, 0, 0, 0});
  file.insert(file.end(), {0, 0, 0, 0});
  const auto length = static_cast<std::uint32_t>(file.size() - 8);
  for (std::size_t i = 0; i < 4; ++i) file[4 + i] = static_cast<std::uint8_t>(length >> 8 * i);
  const Path path = Write("a.webp", file);
  const auto upright = LoadImage(path), stored = LoadImage(path, PixelOrder::kStored);
  ASSERT_TRUE(upright.ok()) << upright.status().message();
  EXPECT_EQ(upright->width, 3);
  EXPECT_EQ(stored->width, 5);
  EXPECT_EQ(stored->pixels, Picture(3).pixels);
}

TEST_F(WebpReader, RefusesWhatIsBrokenOrMoves) {
  const Bytes whole = Encoded(Picture(4));
  for (std::size_t n = 12; n < whole.size(); ++n) {
    const Path path =
        Write("cut.webp", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)));
    ExpectMessage(LoadImage(path).status(), "cut.webp", "corrupt WebP");
  }
  const ImageU8 frames[] = {ImageU8(8, 8, 3, 10), ImageU8(8, 8, 3, 200)};
  ASSERT_TRUE(SaveWebpAnimation(folder_ / "moves.webp", frames).ok());
  ExpectMessage(LoadImage(folder_ / "moves.webp").status(), "moves.webp", "animated");
}

}  // namespace tilegrad::io::webp_reader_test
