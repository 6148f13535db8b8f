// SPDX-License-Identifier: Apache-2.0
// Bytes that are read now and then, such as all pictures of a dataset: too many for the memory, so
// that the system may keep some on disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "base/file.h"

namespace tilegrad {

// Up to 1 GiB in memory. More are mapped from a file without a name in the folder of temporary
// files (TMPDIR, else /tmp), which the system frees with the object or the process; in memory all
// the same if the folder has no room for them.
class ScratchBytes {
 public:
  static constexpr std::size_t kInMemory = std::size_t{1} << 30;
  ScratchBytes() = default;
  explicit ScratchBytes(std::size_t in_memory) : in_memory_(in_memory) {}
  ScratchBytes(ScratchBytes&& other) noexcept
      : in_memory_(other.in_memory_), bytes_(std::exchange(other.bytes_, {})) {}
  ScratchBytes& operator=(ScratchBytes&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~ScratchBytes() { Free(); }

  // The first `size` bytes of a file, as it is while it is mapped; writes to them stay here.
  static Result<ScratchBytes> OfFile(const Path& file, std::size_t size);

  // Zeros instead of what there was. std::bad_alloc if there is no memory either.
  void Resize(std::size_t size);
  void Assign(std::span<const std::uint8_t> bytes);

  std::uint8_t* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }
  std::uint8_t* begin() const { return data(); }
  std::uint8_t* end() const { return data() + size(); }
  std::uint8_t& operator[](std::size_t i) const { return bytes_[i]; }

 private:
  void Free();

  std::size_t in_memory_ = kInMemory;
  std::span<std::uint8_t> bytes_;
};

}  // namespace tilegrad
