// SPDX-License-Identifier: Apache-2.0
#include "base/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace tilegrad {
namespace {

constexpr int kAttempts = 2;
constexpr unsigned kPauseMicroseconds = 10'000;

}  // namespace

FolderLock::FolderLock(const Path& folder)
    : fd_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

Result<FolderLock> FolderLock::Take(const Path& folder) {
  TILEGRAD_TRY(MakeFolder(folder));
  FolderLock lock(folder);
  if (lock.fd_ < 0) return IoError("{}: cannot open: {}", folder.string(), std::strerror(errno));
  // IsHeld takes it for a moment: once more, then.
  for (int attempt = 0; ::flock(lock.fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
       ++attempt) {
    if (attempt == kAttempts)
      return InvalidArgument("{}: in use by another process", folder.string());
    ::usleep(kPauseMicroseconds);
  }
  return lock;
}

bool FolderLock::IsHeld(const Path& folder) {
  const FolderLock probe(folder);
  return probe.fd_ >= 0 && ::flock(probe.fd_, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace tilegrad
