// SPDX-License-Identifier: Apache-2.0
#include "io/guarded_channel.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "base/shortage.h"

namespace tilegrad::io {
namespace {

struct Header {
  std::uint64_t magic, size;
};
constexpr std::uint64_t kChannelMagic =
    0x746c67642d626f78;  // any number that no other file begins with

bool WriteAt(int fd, std::span<const std::uint8_t> bytes, std::size_t at) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += static_cast<std::size_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

bool ReadAt(int fd, std::span<std::uint8_t> bytes, std::size_t at) {
  while (!bytes.empty()) {
    const ssize_t n = ::pread(fd, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += static_cast<std::size_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

// Above the standard streams, which the child replaces: a program may run with those closed.
UniqueFd AboveStreams(int fd) {
  UniqueFd given(fd);
  if (fd < 0 || fd > STDERR_FILENO) return given;
  return UniqueFd(::fcntl(fd, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
}

Status Refused(const char* what) {
  NoteShortage(errno);
  return IoError("could not get {}: {}", what, std::strerror(errno));
}

}  // namespace

void UniqueFd::Close() {
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
}

Result<Mailbox> Mailbox::Open() {
  UniqueFd file = AboveStreams(::memfd_create("tilegrad-guarded", MFD_CLOEXEC));
  if (!file.valid()) return Refused("a memory file");
  return Mailbox(std::move(file));
}

bool Mailbox::Put(std::span<const std::uint8_t> bytes) const {
  const Header header{kChannelMagic, bytes.size()};
  return ::ftruncate(fd(), 0) == 0 && WriteAt(fd(), bytes, sizeof(header)) &&
         WriteAt(fd(), {reinterpret_cast<const std::uint8_t*>(&header), sizeof(header)}, 0);
}

std::optional<Bytes> Mailbox::Get(std::size_t max_bytes) const {
  struct stat info = {};
  Header header = {};
  if (::fstat(fd(), &info) != 0 ||
      !ReadAt(fd(), {reinterpret_cast<std::uint8_t*>(&header), sizeof(header)}, 0) ||
      header.magic != kChannelMagic || header.size > max_bytes ||
      static_cast<std::uint64_t>(info.st_size) != sizeof(header) + header.size) {
    return std::nullopt;
  }
  Bytes out(header.size);
  return ReadAt(fd(), out, sizeof(header)) ? std::optional(std::move(out)) : std::nullopt;
}

Result<SocketPair> SocketPair::Open() {
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
    return Refused("a socket");
  SocketPair pair{AboveStreams(ends[0]), AboveStreams(ends[1])};
  if (!pair.parent.valid() || !pair.child.valid()) return Refused("a socket");
  return pair;
}

}  // namespace tilegrad::io
