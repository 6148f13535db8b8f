// SPDX-License-Identifier: Apache-2.0
// Whole files. A file that we write appears complete under its name or not at all, whatever happens
// in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad {

using Path = std::filesystem::path;
using Bytes = std::vector<std::uint8_t>;

// Errors name the path and the system's reason. A directory, or a file above `max_bytes`, is
// refused before reading.
Result<Bytes> ReadFile(const Path& path, std::size_t max_bytes = std::size_t{4} << 30);
Result<std::string> ReadText(const Path& path, std::size_t max_bytes = std::size_t{1} << 30);

// Writes to a temporary name beside `path`, fsyncs, renames over `path`, fsyncs the folder. On any
// failure (full disk, ...) the temporary is removed and what stood under `path` is untouched.
// Missing parent folders are created. Symbolic links stay, devices and pipes are written to.
Status WriteFileAtomic(const Path& path, std::span<const std::uint8_t> bytes);
Status WriteTextAtomic(const Path& path, std::string_view text);
// The same with contents that lie in several places, one behind the other.
using BytePieces = std::span<const std::span<const std::uint8_t>>;
Status WriteFileAtomic(const Path& path, BytePieces pieces);

// Appends and fsyncs if `durable`. A line that was cut by a crash is the reader's to detect.
Status AppendText(const Path& path, std::string_view text, bool durable);

// Whether a path leads to anything, a folder, a file; no where that cannot be found out.
bool PathExists(const Path& path);
bool IsFolder(const Path& path);
bool IsFile(const Path& path);

Status MakeFolder(const Path& path);  // with parents; existing is fine
// In this order; an error names the first that cannot be removed. What is not there is fine.
Status RemoveFiles(std::span<const Path> files);

// Temporary names of files that are being written, and removal of those a killed process left.

// Where this process writes what will be `path`: beside it, `path`.PROCESS.tmp, or a hash in place
// of a name that would become too long.
Path TemporaryOf(const Path& path);

// Whether a file is called as one that is being written, or was when its process was killed.
bool IsTemporary(const Path& file);

// The temporaries in a folder whose process does not run any more.
class LeftTemporaries {
 public:
  explicit LeftTemporaries(const Path& folder);
  void RemoveAll();
  void RemoveOf(const std::string& name);  // of the file with this name

 private:
  std::multimap<std::string, Path> files_;  // by the name of the file, or the hash in its place
};

// Removes temporaries from `folder`, not from its subfolders, unless their process still runs. The
// caller must be alone in the folder. Files that cannot be removed stay.
void RemoveTemporaries(const Path& folder);
// Only those of one file: for folders that also hold other programs' files.
void RemoveTemporariesOf(const Path& file);

// One process at a time in a folder.

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
