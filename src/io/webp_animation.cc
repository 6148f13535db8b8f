// SPDX-License-Identifier: Apache-2.0
#include "io/webp_animation.h"

#include <webp/encode.h>
#include <webp/mux.h>

#include <memory>

#include "base/error.h"

namespace tilegrad::io {
namespace {

constexpr int kLongest = 65535;             // milliseconds: 16 bits in the file
constexpr std::size_t kMostFrames = 16384;  // together they last less than 2^31 ms

Status InRange(const char* name, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return InvalidArgument("an animation's {} must be in [{}, {}], got {}", name, low, high, value);
}

Status CheckFrames(std::span<const ImageU8> frames) {
  if (frames.empty() || frames.size() > kMostFrames)
    return InvalidArgument("an animation needs 1 to {} frames, got {}", kMostFrames, frames.size());
  const ImageU8& first = frames[0];
  TILEGRAD_TRY(InRange("width", first.width, 1, WEBP_MAX_DIMENSION));
  TILEGRAD_TRY(InRange("height", first.height, 1, WEBP_MAX_DIMENSION));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const ImageU8& f = frames[i];
    if (f.width == first.width && f.height == first.height && (f.channels == 3 || f.channels == 4))
      continue;
    return InvalidArgument(
        "frame {} of an animation is {} x {} pixels of {} channels; all must be {} x {} of 3 or 4",
        i, f.width, f.height, f.channels, first.width, first.height);
  }
  return {};
}

// libwebp's own record of a picture, freed with it.
class Pixels {
 public:
  Pixels() { valid_ = WebPPictureInit(&picture_) != 0; }
  ~Pixels() { WebPPictureFree(&picture_); }
  Pixels(const Pixels&) = delete;
  Pixels& operator=(const Pixels&) = delete;

  bool Import(const ImageU8& image) {
    picture_.use_argb = 1;
    picture_.width = image.width;
    picture_.height = image.height;
    const int stride = image.width * image.channels;
    return valid_ && (image.channels == 4
                          ? WebPPictureImportRGBA(&picture_, image.pixels.data(), stride)
                          : WebPPictureImportRGB(&picture_, image.pixels.data(), stride)) != 0;
  }
  WebPPicture* get() { return &picture_; }

 private:
  WebPPicture picture_;
  bool valid_;
};

class Encoder {
 public:
  explicit Encoder(const AnimationOptions& options) : options_(options) {}

  Result<Bytes> Encode(std::span<const ImageU8> frames) {
    TILEGRAD_TRY(Open(frames[0].width, frames[0].height));
    for (std::size_t i = 0; i < frames.size(); ++i) {
      TILEGRAD_TRY(options_.watch.At({"coding the animation", i, frames.size(), ""}));
      Pixels pixels;
      const int time = static_cast<int>(i) * options_.frame_ms;
      if (!pixels.Import(frames[i]) ||
          !WebPAnimEncoderAdd(encoder_.get(), pixels.get(), time, &config_))
        return Failure("coding a frame");
    }
    const int end = static_cast<int>(frames.size()) * options_.frame_ms;
    if (!WebPAnimEncoderAdd(encoder_.get(), nullptr, end, nullptr)) return Failure("ending");
    return Assemble();
  }

 private:
  Status Open(int width, int height) {
    WebPAnimEncoderOptions animation;
    if (!WebPAnimEncoderOptionsInit(&animation) || !WebPConfigInit(&config_))
      return InternalError("libwebp is of another version than the program was built with");
    config_.quality = static_cast<float>(options_.quality);
    encoder_.reset(WebPAnimEncoderNew(width, height, &animation));
    return encoder_ ? Status() : IoError("not enough memory for {} x {} pixels", width, height);
  }
  Status Failure(const char* what) const {
    return InternalError("{} of an animation failed: {}", what,
                         WebPAnimEncoderGetError(encoder_.get()));
  }
  Result<Bytes> Assemble() {
    WebPData data;
    WebPDataInit(&data);
    const bool done = WebPAnimEncoderAssemble(encoder_.get(), &data) != 0;
    Bytes out(data.bytes, data.bytes + data.size);
    WebPDataClear(&data);
    if (!done) return Failure("putting together the frames");
    return out;
  }

  AnimationOptions options_;
  WebPConfig config_;
  std::unique_ptr<WebPAnimEncoder, decltype(&WebPAnimEncoderDelete)> encoder_{
      nullptr, &WebPAnimEncoderDelete};
};

}  // namespace

Result<Bytes> EncodeWebpAnimation(std::span<const ImageU8> frames,
                                  const AnimationOptions& options) {
  TILEGRAD_TRY(CheckFrames(frames));
  TILEGRAD_TRY(InRange("milliseconds a frame", options.frame_ms, 1, kLongest));
  TILEGRAD_TRY(InRange("quality", options.quality, 0, 100));
  return Encoder(options).Encode(frames);
}

Status SaveWebpAnimation(const Path& path, std::span<const ImageU8> frames,
                         const AnimationOptions& options) {
  auto bytes = EncodeWebpAnimation(frames, options);
  if (!bytes.ok()) return bytes.status().Within(path.string());
  return WriteFileAtomic(path, *bytes);
}

}  // namespace tilegrad::io
