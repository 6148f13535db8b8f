// SPDX-License-Identifier: Apache-2.0
// A large file that several threads write in parts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "base/file.h"

namespace tilegrad {

// Appears complete under its name when finished, or not at all.
class PartsFile {
 public:
  // Creates a temporary file beside `path`, with space reserved for all bytes. kIo: the folder does
  // not exist or is not writable, or the disk has too little room.
  static Result<PartsFile> Create(const Path& path, std::size_t size);
  PartsFile(PartsFile&& other) noexcept
      : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)) {}
  PartsFile& operator=(PartsFile&&) = delete;
  ~PartsFile();

  // Within the size of the file. Thread-safe.
  Status Write(std::size_t offset, std::span<const std::uint8_t> bytes) const;
  // Call once, after all writes. Flushes, and replaces an existing file of that name.
  Status Finish();

 private:
  PartsFile(Path path, int fd) : path_(std::move(path)), fd_(fd) {}

  Path path_;
  int fd_;
};

}  // namespace tilegrad
