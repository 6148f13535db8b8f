// SPDX-License-Identifier: Apache-2.0
// Protects the user's files: an existing file is replaced only with --force, an input of the
// command never. Run and dataset folders know their files by name, so commands that write there
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
  // With `force`, existing files are replaced; inputs never.
  explicit OutputGuard(bool force = false) : force_(force) {}

  bool force() const { return force_; }

  // What is read, and may therefore not be written: a file, or a folder with the files in it. Under
  // any name: links of both kinds, other spellings. Missing paths are ignored.
  void AddInput(const Path& path);
  void AddInputs(std::span<const Path> paths);

  // Whether `file` may be written: it does not exist, is a device or a pipe, or `force`; and it is
  // not an input. kInvalidArgument names it and what to do. Partial files of killed calls are
  // removed.
  Status Check(const Path& file) const;
  Status CheckAll(std::span<const Path> files) const;
  // The second half of that alone, of our own files.
  Status CheckNotRead(std::span<const Path> files) const;

  // Whether a command may fill `folder`: there is no file in it or below, or `force`.
  Status CheckFolder(const Path& folder) const;

 private:
  using Id = std::pair<std::uint64_t, std::uint64_t>;  // device and number of a file
  LeftTemporaries& LeftIn(const Path& folder) const;

  bool force_;
  std::set<Id> inputs_;
  mutable std::map<Path, LeftTemporaries> left_;  // in folders checked so far
};

// Checks `file`, and writes it by `write()`, which returns a Status.
template <class Write>
Status WriteGuarded(const OutputGuard& guard, const Path& file, const Write& write) {
  const Status status = guard.Check(file);
  return status.ok() ? write() : status;
}

}  // namespace tilegrad
