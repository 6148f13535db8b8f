// SPDX-License-Identifier: Apache-2.0
// One process at a time in a folder.
#pragma once

#include <utility>

#include "base/file.h"

namespace tilegrad {

// Held during its lifetime and released by the system if the process is killed.
class FolderLock {
 public:
  FolderLock() = default;  // of nothing
  ~FolderLock();
  FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  // Makes the folder, and locks it itself: no file of ours is left in it. kInvalidArgument if
  // another process holds it. On a file system without locks of folders (NFS) the result locks
  // nothing.
  static Result<FolderLock> Take(const Path& folder);
  // Whether somebody holds it, this process included.
  static bool IsHeld(const Path& folder);

 private:
  explicit FolderLock(const Path& folder);  // opened, not locked

  int fd_ = -1;
};

}  // namespace tilegrad
