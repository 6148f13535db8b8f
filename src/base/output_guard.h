// SPDX-License-Identifier: Apache-2.0
// Nothing of the user's is overwritten. What this program writes for a user it notes in a file
// `.tilegrad-made` beside it, one checksum of name and content a line; a file that is there is
// replaced without asking only if it is, byte for byte, what was written. So a file that somebody
// put there, and one of ours that somebody edited, both stay. A note works for every format, also
// those that have no place for a mark of their own (NPY, CSV).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "base/temporary_file.h"

namespace tilegrad {

class OutputGuard {
 public:
  // With `force`, files that are not ours are replaced, too; inputs never.
  explicit OutputGuard(bool force = false) : force_(force) {}

  // What is read, and may therefore not be written: a file, or a folder with the files in it. Under
  // any name: links of both kinds, other spellings. What is not there is ignored.
  void AddInput(const Path& path);
  void AddInputs(std::span<const Path> paths);

  // Whether `file` may be written: it is not there, it is a device or a pipe, it is ours, or
  // `force`. kInvalidArgument names it and what to do. It is noted before it takes its name, so
  // that what a killed process has just written is ours, too.
  Status Check(const Path& file) const;
  Status CheckAll(std::span<const Path> files) const;

  // Whether a command may fill `folder`: it is not there, this program works in it
  // (base/folder_lock.h), or everything in it and in folders below is ours, or `force`.
  Status CheckFolder(const Path& folder) const;

  // Whether `file` is there and is what this program wrote.
  bool IsOurs(const Path& file) const;

  // Notes that this program has just written `file`. Where no note can be made (somebody else's
  // folder), the file counts as foreign. What killed calls left of this file is removed.
  void Note(const Path& file) const;
  void NoteAll(std::span<const Path> files) const;

 private:
  using Id = std::pair<std::uint64_t, std::uint64_t>;  // device and number of a file
  using Notes = std::set<std::string>;
  Notes& NotesOf(const Path& folder) const;
  LeftTemporaries& LeftIn(const Path& folder) const;
  std::optional<Path> ForeignFile(const Path& folder) const;

  bool force_;
  std::set<Id> inputs_;
  mutable std::map<Path, Notes> notes_;  // of folders that were looked at
  mutable std::map<Path, LeftTemporaries> left_;
};

// Checks `file`, writes it by `write()`, which returns a Status, and notes it.
template <class Write>
Status WriteGuarded(const OutputGuard& guard, const Path& file, const Write& write) {
  if (Status status = guard.Check(file); !status.ok()) return status;
  if (Status status = write(); !status.ok()) return status;
  guard.Note(file);
  return {};
}

}  // namespace tilegrad
