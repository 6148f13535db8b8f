// SPDX-License-Identifier: Apache-2.0
// Bytes one after the other, as a MATLAB file has them: plain, or unpacked while they are read, so
// that what is packed never lies in memory as a whole.
#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/file.h"
#include "tilegrad/status.h"

namespace tilegrad::io {

// Classes and a flag of arrays, as files number them.
inline constexpr std::uint32_t kCellClass = 1, kStructClass = 2, kCharClass = 4,
                               kLogicalFlag = 0x200;

class MatStream {
 public:
  virtual ~MatStream() = default;
  // All of `to`; false if there are fewer, or they cannot be unpacked.
  virtual bool Read(std::span<std::uint8_t> to) = 0;
};

class PlainStream : public MatStream {
 public:
  explicit PlainStream(std::span<const std::uint8_t> bytes) : left_(bytes) {}
  bool Read(std::span<std::uint8_t> to) override;

 private:
  std::span<const std::uint8_t> left_;
};

class InflateStream : public MatStream {
 public:
  explicit InflateStream(std::span<const std::uint8_t> packed);
  ~InflateStream() override;
  InflateStream(const InflateStream&) = delete;
  InflateStream& operator=(const InflateStream&) = delete;
  bool Read(std::span<std::uint8_t> to) override;

 private:
  z_stream zlib_{};
  bool works_;
};

// `bytes` as zlib packs them.
Bytes Deflated(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
