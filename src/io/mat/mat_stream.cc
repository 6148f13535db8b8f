// SPDX-License-Identifier: Apache-2.0
#include "io/mat/mat_stream.h"

#include <algorithm>
#include <cstring>

namespace tilegrad::io {

bool PlainStream::Read(std::span<std::uint8_t> to) {
  if (to.size() > left_.size()) return false;
  if (!to.empty()) std::memcpy(to.data(), left_.data(), to.size());
  left_ = left_.subspan(to.size());
  return true;
}

InflateStream::InflateStream(std::span<const std::uint8_t> packed)
    : works_(packed.size() <= UINT32_MAX && inflateInit(&zlib_) == Z_OK) {
  zlib_.next_in = const_cast<std::uint8_t*>(packed.data());  // zlib does not write there
  zlib_.avail_in = static_cast<uInt>(packed.size());
}

InflateStream::~InflateStream() { inflateEnd(&zlib_); }

bool InflateStream::Read(std::span<std::uint8_t> to) {
  if (!works_ || to.size() > UINT32_MAX) return false;
  zlib_.next_out = to.data();
  zlib_.avail_out = static_cast<uInt>(to.size());
  while (zlib_.avail_out > 0) {
    const int result = inflate(&zlib_, Z_NO_FLUSH);
    if (result == Z_STREAM_END) break;
    if (result != Z_OK) return works_ = false;
  }
  return zlib_.avail_out == 0;
}

Bytes Deflated(std::span<const std::uint8_t> bytes) {
  uLongf size = compressBound(bytes.size());
  Bytes out(size);
  // Cannot fail: the buffer is as large as it may get, and memory is the process's.
  compress2(out.data(), &size, bytes.data(), bytes.size(), Z_BEST_SPEED);
  out.resize(size);
  return out;
}

}  // namespace tilegrad::io
