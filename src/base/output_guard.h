// SPDX-License-Identifier: Apache-2.0
// Nothing of the user's is overwritten: a file that is there is replaced only by --force, and one
// that is read here not even by that. Folders of our own (a run, a dataset) know their files by
// name, so commands that work there ask this only about what they read.
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
  // With `force`, files that are there are replaced; inputs never.
  explicit OutputGuard(bool force = false) : force_(force) {}

  bool force() const { return force_; }

  // What is read, and may therefore not be written: a file, or a folder with the files in it. Under
  // any name: links of both kinds, other spellings. What is not there is ignored.
  void AddInput(const Path& path);
  void AddInputs(std::span<const Path> paths);

  // Whether `file` may be written: it is not there, it is a device or a pipe, or `force`; and
  // nobody reads it here. kInvalidArgument names it and what to do. What killed calls left
  // half-written of it is removed.
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
  mutable std::map<Path, LeftTemporaries> left_;  // in folders that were looked at
};

// Checks `file`, and writes it by `write()`, which returns a Status.
template <class Write>
Status WriteGuarded(const OutputGuard& guard, const Path& file, const Write& write) {
  const Status status = guard.Check(file);
  return status.ok() ? write() : status;
}

}  // namespace tilegrad
