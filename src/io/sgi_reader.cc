// SPDX-License-Identifier: Apache-2.0
#include "io/sgi_reader.h"

#include "base/read_budget.h"
#include "io/image_check.h"
#include "io/image_header.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

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
        "{}: corrupt SGI image: storage {}, {} bytes a sample, {} dimensions; 0 or 1, 1 or 2, and "
        "1 to 3 are possible",
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
  static constexpr std::size_t kTableEntry = 8;  // a row's place and length, of 4 bytes each

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

  // Packets of one number whose low 7 bits count: 0 ends the row; with bit 7 as many samples
  // follow, else one that is repeated.
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

bool IsSgi(ByteSpan bytes) { return bytes.size() > 2 && bytes[0] == 0x01 && bytes[1] == 0xda; }

Result<ImageU8> DecodeSgi(ByteSpan bytes, const std::string& name) {
  TILEGRAD_ASSIGN(const SgiHeader header, ReadHeader(bytes, name));
  return SgiReader(bytes, header, name).Read();
}

}  // namespace tilegrad::io
