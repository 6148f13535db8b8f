// SPDX-License-Identifier: Apache-2.0
#include "io/pnm_reader.h"

#include <algorithm>
#include <string_view>

#include "base/read_budget.h"
#include "io/image_check.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr int kMostSample = 65535;

bool IsSpace(std::uint8_t c) {
  return std::string_view(" \t\n\v\f\r").find(static_cast<char>(c)) != std::string_view::npos;
}

// Numbers with white space and comments before each.
class PnmHeader {
 public:
  PnmHeader(ByteSpan bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Result<int> Number() {
    PassSpace();
    constexpr int kMost = 100'000'000;  // no image has as many; ten times that is still an int
    const std::size_t begin = at_;
    int value = 0;
    for (; at_ < bytes_.size() && bytes_[at_] >= '0' && bytes_[at_] <= '9'; ++at_) {
      value = value * 10 + (bytes_[at_] - '0');
      if (value > kMost)
        return DataLoss("{}: corrupt PNM: the number at byte {} is huge", name_, begin);
    }
    if (at_ == begin)
      return DataLoss("{}: truncated or corrupt PNM: no number at byte {}", name_, begin);
    return value;
  }

  // One byte of white space ends the header.
  ByteSpan Samples() const { return bytes_.subspan(std::min(at_ + 1, bytes_.size())); }

 private:
  void PassSpace() {
    while (at_ < bytes_.size() && (IsSpace(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') {
        while (at_ < bytes_.size() && bytes_[at_] != '\n' && bytes_[at_] != '\r') ++at_;
      } else {
        ++at_;
      }
    }
  }

  ByteSpan bytes_;
  const std::string& name_;
  std::size_t at_ = 2;  // behind "P5"
};

std::uint8_t Scale(int sample, int most) {
  return static_cast<std::uint8_t>((std::min(sample, most) * 255 + most / 2) / most);
}

}  // namespace

bool IsPnm(ByteSpan bytes) {
  return bytes.size() > 2 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6');
}

Result<ImageU8> DecodePnm(ByteSpan bytes, const std::string& name) {
  PnmHeader header(bytes, name);
  TILEGRAD_ASSIGN(const int width, header.Number());
  TILEGRAD_ASSIGN(const int height, header.Number());
  TILEGRAD_ASSIGN(const int most, header.Number());
  TILEGRAD_TRY(CheckImageSize(width, height, name));
  if (most < 1 || most > kMostSample)
    return DataLoss("{}: corrupt PNM: the largest sample is {}, not within [1, {}]", name, most,
                    kMostSample);
  const int channels = bytes[1] == '6' ? 3 : 1;
  const std::size_t count = static_cast<std::size_t>(width) * height * channels,
                    size = most > 255 ? 2 : 1;
  const ByteSpan samples = header.Samples();
  if (samples.size() < count * size) {
    return DataLoss("{}: truncated PNM: {} x {} pixels need {} bytes, {} are there", name, width,
                    height, count * size, samples.size());
  }
  TILEGRAD_TRY(ReadBudget::Take(count, name));
  ImageU8 image(width, height, channels);
  for (std::size_t i = 0; i < count; ++i) {
    const int sample = size == 2 ? samples[2 * i] << 8 | samples[2 * i + 1] : samples[i];
    image.pixels[i] = Scale(sample, most);
  }
  return image;
}

}  // namespace tilegrad::io
