// SPDX-License-Identifier: Apache-2.0
#include "base/parts_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace tilegrad {
namespace {

Status CannotWrite(const Path& path, int error) {
  return IoError("{}: cannot be written: {}", path.string(), std::strerror(error));
}

}  // namespace

Result<PartsFile> PartsFile::Create(const Path& path, std::size_t size) {
  const Path temporary = TemporaryOf(path);
  const int fd = ::open(temporary.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0644);
  if (fd < 0) return CannotWrite(path, errno);
  PartsFile file(path, fd);
  const int error = ::posix_fallocate(fd, 0, static_cast<off_t>(size));
  if (error != 0) return CannotWrite(path, error);
  return file;
}

PartsFile::~PartsFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(TemporaryOf(path_).c_str());
}

Status PartsFile::Write(std::size_t offset, std::span<const std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return CannotWrite(path_, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::size_t>(count);
  }
  return {};
}

Status PartsFile::Finish() {
  const Path temporary = TemporaryOf(path_);
  if (::fsync(fd_) != 0 || ::rename(temporary.c_str(), path_.c_str()) != 0)
    return CannotWrite(path_, errno);
  ::close(std::exchange(fd_, -1));
  return {};
}

}  // namespace tilegrad
