// SPDX-License-Identifier: Apache-2.0
// A large file that threads write in parts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "base/file.h"

namespace tilegrad {

// Appears whole under its name when it is finished, or not at all.
class PartsFile {
 public:
  // Under a temporary name beside `path`, with room for all of its bytes. kIo: the folder is not
  // there, may not be written to, or the disk has too little room.
  static Result<PartsFile> Create(const Path& path, std::size_t size);
  PartsFile(PartsFile&& other) noexcept
      : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)) {}
  PartsFile& operator=(PartsFile&&) = delete;
  ~PartsFile();

  // Within the size. Thread-safe.
  Status Write(std::size_t offset, std::span<const std::uint8_t> bytes) const;
  // Once, after all writes. Flushes, and replaces what stood under the name.
  Status Finish();

 private:
  PartsFile(Path path, int fd) : path_(std::move(path)), fd_(fd) {}

  Path path_;
  int fd_;
};

}  // namespace tilegrad
