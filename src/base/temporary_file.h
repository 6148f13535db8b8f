// SPDX-License-Identifier: Apache-2.0
// Files under a name of their own until they are whole, and what a killed process left of them.
#pragma once

#include <span>
#include <string>

#include "base/file.h"

namespace tilegrad {

// Where this process writes what will be `path`: beside it, `path`.PROCESS.tmp, or a hash in place
// of a name that would become too long.
Path TemporaryOf(const Path& path);

// Removes temporaries from `folder`, not from folders in it. Those of processes that still run
// stay. For who works alone in the folder; what cannot be removed stays.
void RemoveTemporaries(const Path& folder);
// Only those of files of these names: for folders that hold what is not ours, too.
void RemoveTemporaries(const Path& folder, std::span<const std::string> names);

}  // namespace tilegrad
