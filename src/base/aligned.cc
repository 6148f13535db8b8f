// SPDX-License-Identifier: Apache-2.0
#include "base/aligned.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <new>
#include <system_error>

#include "base/error.h"

namespace tilegrad {
namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;

std::align_val_t AlignmentOf(std::size_t bytes) {
  return std::align_val_t(bytes >= kHugePage ? kHugePage : kAlignment);
}

// Reserves `size` bytes, so that no write to the mapping can fail; -1 if there is no room.
int OpenScratchFile(std::size_t size) {
  std::error_code error;
  static std::atomic<unsigned> count = 0;
  const auto file = std::filesystem::temp_directory_path(error) /
                    fmt::format("tilegrad-{}-{}", ::getpid(), count++);
  const int fd = ::open(file.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0600);
  if (fd < 0) return -1;
  ::unlink(file.c_str());
  if (::posix_fallocate(fd, 0, static_cast<off_t>(size)) == 0) return fd;
  ::close(fd);
  return -1;
}

void* MapBytes(std::size_t size, std::size_t in_memory) {
  const int fd = size > in_memory ? OpenScratchFile(size) : -1;
  const int kind = fd < 0 ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED;
  void* const bytes = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, kind, fd, 0);
  if (fd >= 0) ::close(fd);
  return bytes;
}

}  // namespace

void* AllocateAligned(std::size_t bytes) {
  void* data = ::operator new(bytes, AlignmentOf(bytes));
  // Advice only: if the system ignores it, only speed suffers.
  if (bytes >= kHugePage) madvise(data, bytes, MADV_HUGEPAGE);
  return data;
}

void FreeAligned(void* data, std::size_t bytes) { ::operator delete(data, AlignmentOf(bytes)); }

void* Arena::AllocateBytes(std::size_t bytes) {
  bytes = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  if (blocks_.empty() || used_ + bytes > blocks_.back().size()) {
    blocks_.emplace_back(std::max(bytes, std::max<std::size_t>(capacity(), 64 * 1024)));
    used_ = 0;
  }
  std::byte* p = blocks_.back().data() + used_;
  used_ += bytes;
  return p;
}

void Arena::Reset() {
  if (blocks_.size() > 1) {
    const std::size_t total = capacity();
    blocks_.clear();
    blocks_.emplace_back(total);
  }
  used_ = 0;
}

std::size_t Arena::capacity() const {
  std::size_t total = 0;
  for (const auto& block : blocks_) total += block.size();
  return total;
}

Result<ScratchBytes> ScratchBytes::OfFile(const Path& file, std::size_t size) {
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  void* const bytes =
      fd < 0 ? MAP_FAILED
             : ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_NORESERVE, fd, 0);
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (bytes == MAP_FAILED)
    return IoError("{}: cannot be mapped: {}", file.string(), std::strerror(error));
  ::madvise(bytes, size, MADV_RANDOM);  // read-ahead would fill the memory with other pictures
  ScratchBytes out;
  out.bytes_ = {static_cast<std::uint8_t*>(bytes), size};
  return out;
}

void ScratchBytes::Resize(std::size_t size) {
  Free();
  if (size == 0) return;
  void* const bytes = MapBytes(size, in_memory_);
  if (bytes == MAP_FAILED) throw std::bad_alloc();
  bytes_ = {static_cast<std::uint8_t*>(bytes), size};
}

void ScratchBytes::Assign(std::span<const std::uint8_t> bytes) {
  Resize(bytes.size());
  std::copy(bytes.begin(), bytes.end(), begin());
}

void ScratchBytes::Free() {
  if (!bytes_.empty()) ::munmap(bytes_.data(), bytes_.size());
  bytes_ = {};
}

}  // namespace tilegrad
