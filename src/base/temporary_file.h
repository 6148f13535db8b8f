// SPDX-License-Identifier: Apache-2.0
// Temporary names of files that are being written, and removal of those a killed process left.
#pragma once

#include <span>
#include <string>

#include "base/file.h"

namespace tilegrad {

// Where this process writes what will be `path`: beside it, `path`.PROCESS.tmp, or a hash in place
// of a name that would become too long.
Path TemporaryOf(const Path& path);

// Removes temporaries from `folder`, not from its subfolders, unless their process still runs. The
// caller must be alone in the folder. Files that cannot be removed stay.
void RemoveTemporaries(const Path& folder);
// Only those of files with these names: for folders that also hold other programs' files.
void RemoveTemporaries(const Path& folder, std::span<const std::string> names);
// Of one file.
void RemoveTemporariesOf(const Path& file);

}  // namespace tilegrad
