// SPDX-License-Identifier: Apache-2.0
// Temporary names of files that are being written, and removal of those a killed process left.
#pragma once

#include <map>
#include <string>

#include "base/file.h"

namespace tilegrad {

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

}  // namespace tilegrad
