// SPDX-License-Identifier: Apache-2.0
// Protects the user's files: commands replace an existing file only with --force, and never one of
// their inputs. Run and dataset folders know their files by name, so commands that write there
// check only their inputs.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "base/file.h"

namespace tilegrad {

class OutputGuard {
 public:
  // `force` allows replacing existing files; never inputs.
  explicit OutputGuard(bool force = false) : force_(force) {}

  bool force() const { return force_; }

  // Marks a file, or a folder with the files in it, as read and therefore not writable, under any
  // name: links of both kinds, other spellings. Ignores missing paths.
  void AddInput(const Path& path);
  void AddInputs(std::span<const Path> paths);

  // Whether `file` may be written: it does not exist, is a device or a pipe, or `force`; and it is
  // not an input. kInvalidArgument names it and what to do. Removes partial files that killed calls
  // left.
  Status Check(const Path& file) const;
  Status CheckAll(std::span<const Path> files) const;
  // Checks only that our own files are not inputs.
  Status CheckNotRead(std::span<const Path> files) const;

  // Whether a command may fill `folder`: it holds no file, not even in subfolders, or `force`.
  Status CheckFolder(const Path& folder) const;

 private:
  using Id = std::pair<std::uint64_t, std::uint64_t>;  // device and inode
  LeftTemporaries& LeftIn(const Path& folder) const;

  bool force_;
  std::set<Id> inputs_;
  mutable std::map<Path, LeftTemporaries> left_;  // of the folders checked so far
};

// Checks `file`, then writes it with `write()`, which returns a Status.
template <class Write>
Status WriteGuarded(const OutputGuard& guard, const Path& file, const Write& write) {
  const Status status = guard.Check(file);
  return status.ok() ? write() : status;
}

}  // namespace tilegrad
