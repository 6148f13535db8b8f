// SPDX-License-Identifier: Apache-2.0
// Whole-file reads and atomic writes: a file appears complete under its name or not at all,
// whatever happens in between.
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

// Errors name the path and the system's reason. Refuses directories and files above `max_bytes`
// before reading.
Result<Bytes> ReadFile(const Path& path, std::size_t max_bytes = std::size_t{4} << 30);
Result<std::string> ReadText(const Path& path, std::size_t max_bytes = std::size_t{1} << 30);

// Writes to a temporary file beside `path`, fsyncs, renames it over `path`, fsyncs the folder. On
// any failure (full disk, ...) removes the temporary and leaves the old file untouched. Creates
// missing parent folders. Keeps symbolic links; writes to devices and pipes directly.
Status WriteFileAtomic(const Path& path, std::span<const std::uint8_t> bytes);
Status WriteTextAtomic(const Path& path, std::string_view text);
// The same for contents in several pieces, written in order.
using BytePieces = std::span<const std::span<const std::uint8_t>>;
Status WriteFileAtomic(const Path& path, BytePieces pieces);

// Appends; fsyncs if `durable`. Readers must detect a line cut short by a crash.
Status AppendText(const Path& path, std::string_view text, bool durable);

// Whether a path leads to anything (file, folder, ...); false if that cannot be determined.
bool PathExists(const Path& path);
bool IsFolder(const Path& path);
bool IsFile(const Path& path);

Status MakeFolder(const Path& path);  // with parents; OK if it exists
// Removes in this order; an error names the first file that could not be removed. Missing files are
// fine.
Status RemoveFiles(std::span<const Path> files);

// Temporary names of files being written, and removal of those that a killed process left behind.

// The name under which this process writes the future `path`: beside it, `path`.PROCESS.tmp, with a
// hash in place of a name that would become too long.
Path TemporaryOf(const Path& path);

// Whether the name is that of a file being written, or left by a killed process.
bool IsTemporary(const Path& file);

// The temporaries in a folder whose processes no longer run.
class LeftTemporaries {
 public:
  explicit LeftTemporaries(const Path& folder);
  void RemoveAll();
  void RemoveOf(const std::string& name);  // those of the file with this name

 private:
  std::multimap<std::string, Path> files_;  // by the file's name, or by the hash in its place
};

// Removes temporaries from `folder`, not from its subfolders, unless their process still runs. The
// caller must hold the folder alone. Files that cannot be removed stay.
void RemoveTemporaries(const Path& folder);
// Only those of one file: for folders that also hold files of other programs.
void RemoveTemporariesOf(const Path& file);

// Allows one process at a time in a folder.

// Holds the lock during its lifetime; the system releases it if the process is killed.
class FolderLock {
 public:
  FolderLock() = default;  // holds nothing
  ~FolderLock();
  FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  // Creates the folder and locks the folder itself, so no lock file stays in it. kInvalidArgument
  // if another process holds it. On a file system that cannot lock folders (NFS) the result locks
  // nothing.
  static Result<FolderLock> Take(const Path& folder);
  // Whether any process holds it, this one included.
  static bool IsHeld(const Path& folder);

 private:
  explicit FolderLock(const Path& folder);  // opened, not locked

  int fd_ = -1;
};

}  // namespace tilegrad
