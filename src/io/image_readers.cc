// SPDX-License-Identifier: Apache-2.0
#include "io/image_readers.h"

#include <webp/decode.h>

#include <algorithm>

#include "base/read_budget.h"

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
    constexpr int kMost = 100'000'000;  // beyond any image; ten times that still fits an int
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
  std::size_t at_ = 2;  // after "P5"
};

std::uint8_t Scale(int sample, int most) {
  return static_cast<std::uint8_t>((std::min(sample, most) * 255 + most / 2) / most);
}

constexpr std::size_t kHeaderBytes = 512;
constexpr int kMostChannels = 4;

std::uint8_t ToByte(std::uint32_t sample, std::size_t bytes) {
  return static_cast<std::uint8_t>(bytes == 1 ? sample : (sample * 255 + 32767) / 65535);
}

struct SgiHeader {
  bool runs = false;             // rows are run-length encoded
  std::size_t sample_bytes = 1;  // 1 or 2
  int width = 0, height = 1, channels = 1;
};

Result<SgiHeader> ReadHeader(ByteSpan bytes, const std::string& name) {
  if (bytes.size() < kHeaderBytes) {
    return DataLoss("{}: truncated SGI image: a header has {} bytes, {} are there", name,
                    kHeaderBytes, bytes.size());
  }
  const std::uint32_t dimensions = BigEndian(bytes.subspan(4, 2)),
                      colormap = BigEndian(bytes.subspan(104, 4));
  if (bytes[2] > 1 || bytes[3] < 1 || bytes[3] > 2 || dimensions < 1 || dimensions > 3) {
    return DataLoss(
        "{}: corrupt SGI image: storage {}, {} bytes a sample, {} dimensions; must be 0 or 1, 1 or "
        "2, and 1 to 3",
        name, bytes[2], bytes[3], dimensions);
  }
  if (colormap != 0)
    return DataLoss("{}: an SGI image with a palette (colour map {}); save it as RGB", name,
                    colormap);
  SgiHeader header{.runs = bytes[2] == 1, .sample_bytes = bytes[3]};
  header.width = static_cast<int>(BigEndian(bytes.subspan(6, 2)));
  if (dimensions > 1) header.height = static_cast<int>(BigEndian(bytes.subspan(8, 2)));
  if (dimensions > 2) header.channels = static_cast<int>(BigEndian(bytes.subspan(10, 2)));
  TILEGRAD_TRY(CheckImageSize(header.width, header.height, name));
  if (header.channels < 1 || header.channels > kMostChannels)
    return DataLoss("{}: an SGI image of {} channels; 1 to {} are read", name, header.channels,
                    kMostChannels);
  return header;
}

class SgiReader {
 public:
  SgiReader(ByteSpan bytes, const SgiHeader& header, const std::string& name)
      : bytes_(bytes),
        header_(header),
        name_(name),
        rows_(static_cast<std::size_t>(header.height) * static_cast<std::size_t>(header.channels)),
        row_bytes_(static_cast<std::size_t>(header.width) * header.sample_bytes) {}

  Result<ImageU8> Read() {
    const std::size_t need = rows_ * (header_.runs ? kTableEntry : row_bytes_);
    if (bytes_.size() - kHeaderBytes < need) {
      return DataLoss("{}: truncated SGI image: {} x {} pixels of {} channels need {} bytes {}{}",
                      name_, header_.width, header_.height, header_.channels, need,
                      header_.runs ? "of row tables, " : "",
                      fmt::format("behind the header, {} are there", bytes_.size() - kHeaderBytes));
    }
    TILEGRAD_TRY(ReadBudget::Take(rows_ * static_cast<std::size_t>(header_.width), name_));
    image_ = ImageU8(header_.width, header_.height, header_.channels);
    for (std::size_t row = 0; row < rows_; ++row) {
      if (header_.runs)
        TILEGRAD_TRY(ReadRuns(row));
      else
        ReadPlain(row);
    }
    return std::move(image_);
  }

 private:
  static constexpr std::size_t kTableEntry = 8;  // a row's offset and length, 4 bytes each

  // Rows are stored channel by channel, each from the bottom up.
  std::uint8_t* Target(std::size_t row, std::size_t x) {
    const auto height = static_cast<std::size_t>(header_.height);
    const std::size_t y = height - 1 - row % height, channel = row / height;
    return &image_.pixels[(y * static_cast<std::size_t>(header_.width) + x) *
                              static_cast<std::size_t>(header_.channels) +
                          channel];
  }

  void ReadPlain(std::size_t row) {
    const ByteSpan data = bytes_.subspan(kHeaderBytes + row * row_bytes_, row_bytes_);
    for (std::size_t x = 0; x * header_.sample_bytes < data.size(); ++x)
      *Target(row, x) = Sample(data, x);
  }

  std::uint8_t Sample(ByteSpan data, std::size_t index) const {
    const std::size_t size = header_.sample_bytes;
    return ToByte(BigEndian(data.subspan(index * size, size)), size);
  }

  Status Damaged(std::size_t row, std::string_view what) const {
    const auto height = static_cast<std::size_t>(header_.height);
    return DataLoss("{}: corrupt SGI image: row {} of channel {} {}", name_, row % height,
                    row / height, what);
  }

  // Packets start with a number whose low 7 bits are a count: 0 ends the row; with bit 7 set that
  // many samples follow, else one sample to repeat.
  Status ReadRuns(std::size_t row) {
    const std::size_t at = BigEndian(bytes_.subspan(kHeaderBytes + 4 * row, 4)),
                      length = BigEndian(bytes_.subspan(kHeaderBytes + 4 * (rows_ + row), 4));
    if (at > bytes_.size() || length > bytes_.size() - at)
      return Damaged(row, "lies beyond the end of the file");
    const ByteSpan data = bytes_.subspan(at, length - length % header_.sample_bytes);
    const std::size_t samples = data.size() / header_.sample_bytes,
                      width = static_cast<std::size_t>(header_.width);
    std::size_t x = 0;
    for (std::size_t next = 0; next < samples;) {
      const std::uint8_t packet = data[(next + 1) * header_.sample_bytes - 1];
      const std::size_t count = packet & 0x7f, step = packet & 0x80 ? 1 : 0;
      if (count == 0) break;
      if (count > width - x) return Damaged(row, "is longer than the picture is wide");
      if (++next + step * (count - 1) >= samples) return Damaged(row, "ends within a run");
      for (std::size_t i = 0; i < count; ++i) *Target(row, x++) = Sample(data, next + i * step);
      next += step == 1 ? count : 1;
    }
    return x == width ? Status() : Damaged(row, "is shorter than the picture is wide");
  }

  ByteSpan bytes_;
  const SgiHeader header_;
  const std::string& name_;
  const std::size_t rows_, row_bytes_;  // rows of all channels; bytes of one that is not encoded
  ImageU8 image_;
};

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

bool IsSgi(ByteSpan bytes) { return bytes.size() > 2 && bytes[0] == 0x01 && bytes[1] == 0xda; }

Result<ImageU8> DecodeSgi(ByteSpan bytes, const std::string& name) {
  TILEGRAD_ASSIGN(const SgiHeader header, ReadHeader(bytes, name));
  return SgiReader(bytes, header, name).Read();
}

bool IsWebp(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.size() >= 12 && text.starts_with("RIFF") && text.substr(8, 4) == "WEBP";
}

Result<ImageU8> DecodeWebp(std::span<const std::uint8_t> bytes, const std::string& name) {
  const auto broken = [&] { return DataLoss("{}: a truncated or corrupt WebP image", name); };
  WebPBitstreamFeatures header;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &header) != VP8_STATUS_OK) return broken();
  if (header.has_animation != 0)
    return DataLoss("{}: an animated WebP; save one of its frames", name);
  TILEGRAD_TRY(CheckImageSize(header.width, header.height, name));
  const int channels = header.has_alpha != 0 ? 4 : 3;
  const auto size = static_cast<std::size_t>(header.width) *
                    static_cast<std::size_t>(header.height) * static_cast<std::size_t>(channels);
  TILEGRAD_TRY(ReadBudget::Take(size, name));
  ImageU8 image(header.width, header.height, channels);
  const auto decode = channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(bytes.data(), bytes.size(), image.pixels.data(), size, header.width * channels) ==
      nullptr) {
    return broken();
  }
  return image;
}

}  // namespace tilegrad::io
