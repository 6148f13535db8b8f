// SPDX-License-Identifier: Apache-2.0
// Animations are read back by libwebp's own decoder.
#include "io/webp_animation.h"

#include <gtest/gtest.h>
#include <webp/demux.h>
#include <webp/encode.h>

#include <cstdlib>
#include <memory>

#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::webp_animation_test {

// A red square that moves over grey, one step a frame.
std::vector<ImageU8> MovingSquare(int count, int channels) {
  std::vector<ImageU8> frames;
  for (int i = 0; i < count; ++i) {
    ImageU8& image = frames.emplace_back(48, 32, channels, std::uint8_t{200});
    for (int y = 8; y < 24; ++y) {
      for (int x = 2 * i; x < 2 * i + 16; ++x) {
        image.at(x, y)[0] = 220;
        image.at(x, y)[1] = 30;
        image.at(x, y)[2] = 40;
      }
    }
  }
  return frames;
}

struct Decoded {
  WebPAnimInfo info;
  std::vector<Bytes> frames;  // RGBA
  std::vector<int> ends;      // milliseconds
};

Decoded Decode(const Bytes& bytes) {
  Decoded out{};
  const WebPData data{bytes.data(), bytes.size()};
  const std::unique_ptr<WebPAnimDecoder, decltype(&WebPAnimDecoderDelete)> decoder(
      WebPAnimDecoderNew(&data, nullptr), &WebPAnimDecoderDelete);
  EXPECT_TRUE(decoder);
  if (!decoder || !WebPAnimDecoderGetInfo(decoder.get(), &out.info)) return out;
  std::uint8_t* pixels = nullptr;
  int end = 0;
  while (WebPAnimDecoderGetNext(decoder.get(), &pixels, &end)) {
    out.frames.emplace_back(pixels, pixels + 4 * out.info.canvas_width * out.info.canvas_height);
    out.ends.push_back(end);
  }
  return out;
}

TEST(WebpAnimation, DecodesToItsFrames) {
  for (const int channels : {3, 4}) {
    const std::vector<ImageU8> frames = MovingSquare(12, channels);
    const auto bytes = Ok(EncodeWebpAnimation(frames, {.frame_ms = 50, .quality = 90}));
    const Decoded back = Decode(*bytes);
    EXPECT_EQ(back.info.canvas_width, 48u);
    EXPECT_EQ(back.info.canvas_height, 32u);
    ASSERT_EQ(back.frames.size(), frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(back.ends[i], 50 * static_cast<int>(i + 1));
      double sum = 0;  // of differences; 4:2:0 colours blur the square's edge
      for (std::size_t p = 0; p < 48 * 32; ++p) {
        for (std::size_t c = 0; c < 3; ++c) {
          const auto channel = static_cast<std::size_t>(channels);
          sum += std::abs(int{back.frames[i][4 * p + c]} - int{frames[i].pixels[channel * p + c]});
        }
      }
      EXPECT_LT(sum / (3 * 48 * 32), 6) << "frame " << i;  // another frame's square: 15 and more
    }
  }
}

TEST(WebpAnimation, LoopsForEverAndHasTheSameBytesAgain) {
  const std::vector<ImageU8> frames = MovingSquare(5, 3);
  const Bytes first = EncodeWebpAnimation(frames).value();
  EXPECT_EQ(Decode(first).info.loop_count, 0u);
  EXPECT_EQ(EncodeWebpAnimation(frames).value(), first);
}

TEST(WebpAnimation, RefusesWhatCannotBe) {
  std::vector<ImageU8> frames = MovingSquare(3, 3);
  ExpectMessage(EncodeWebpAnimation({}).status(), "needs 1 to 16384 frames, got 0");
  ExpectMessage(EncodeWebpAnimation(frames, {.frame_ms = 0}).status(), "milliseconds", "got 0");
  ExpectMessage(EncodeWebpAnimation(frames, {.quality = 101}).status(), "quality", "got 101");
  const ImageU8 wide(16384, 1, 3), grey(48, 32, 1);
  ExpectMessage(EncodeWebpAnimation({&wide, 1}).status(), "width", "16383");
  ExpectMessage(EncodeWebpAnimation({&grey, 1}).status(), "frame 0", "1 channels");
  frames[2] = ImageU8(48, 31, 3);
  ExpectMessage(EncodeWebpAnimation(frames).status(), "frame 2", "48 x 31");
}

using WebpFile = TempFolderTest;

TEST_F(WebpFile, ErrorsNameTheFile) {
  const std::vector<ImageU8> frames = MovingSquare(2, 3);
  ASSERT_TRUE(SaveWebpAnimation(folder_ / "a.webp", frames).ok());
  EXPECT_EQ(ReadFile(folder_ / "a.webp").value(), EncodeWebpAnimation(frames).value());
  ExpectMessage(SaveWebpAnimation(folder_ / "b.webp", {}), "b.webp", "frames");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "b.webp"));
}

// WebP files of libwebp's own encoder.
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
    const auto back = Ok(LoadImage(Write("a.webp", Encoded(image))));
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
  const auto upright = Ok(LoadImage(path));
  const auto stored = Ok(LoadStoredImage(path));
  EXPECT_EQ(upright->width, 3);
  EXPECT_EQ(stored->image.width, 5);
  EXPECT_EQ(stored->image.pixels, Picture(3).pixels);
}

TEST_F(WebpReader, RefusesWhatIsBrokenOrMoves) {
  const Bytes whole = Encoded(Picture(4));
  for (std::size_t n = 12; n < whole.size(); ++n) {
    Write("cut.webp", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)));
    ExpectMessage(LoadImage(folder_ / "cut.webp").status(), "cut.webp", "corrupt WebP");
  }
  const ImageU8 frames[] = {ImageU8(8, 8, 3, 10), ImageU8(8, 8, 3, 200)};
  ASSERT_TRUE(SaveWebpAnimation(folder_ / "moves.webp", frames).ok());
  ExpectMessage(LoadImage(folder_ / "moves.webp").status(), "moves.webp", "animated");
}

}  // namespace tilegrad::io::webp_animation_test
