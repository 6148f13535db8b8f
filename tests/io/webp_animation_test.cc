// SPDX-License-Identifier: Apache-2.0
// Animations are read back by libwebp's own decoder.
#include "io/webp_animation.h"

#include <gtest/gtest.h>
#include <webp/demux.h>

#include <cstdlib>
#include <memory>

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
    const auto bytes = EncodeWebpAnimation(frames, {.frame_ms = 50, .loops = 3, .quality = 90});
    ASSERT_TRUE(bytes.ok()) << bytes.status().message();
    const Decoded back = Decode(*bytes);
    EXPECT_EQ(back.info.canvas_width, 48u);
    EXPECT_EQ(back.info.canvas_height, 32u);
    EXPECT_EQ(back.info.loop_count, 3u);
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
  ExpectMessage(EncodeWebpAnimation(frames, {.loops = -1}).status(), "loops", "got -1");
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

}  // namespace tilegrad::io::webp_animation_test
