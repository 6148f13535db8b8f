// SPDX-License-Identifier: Apache-2.0
// What stands in a run's folder, by name: the run and commands that look at it write these without
// asking, and a run that starts anew takes them away first.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

inline constexpr const char* kTrainSettings = "config.toml";  // of a training
inline constexpr const char* kFitSettings = "fit.txt";        // of a fit

// Files BEGINNING00001500ENDING of a folder by their step; files that people put beside them are
// not. An error where the folder is there and cannot be read: that is not a folder without such
// files.
Result<std::map<std::int64_t, Path>> FilesOfSteps(const Path& folder, std::string_view beginning,
                                                  std::string_view ending);

// Whether it holds a run, which may have done no step yet: settings, or checkpoints.
Result<bool> HoldsRun(const Path& folder);

// The folder of the run whose folder or checkpoint `path` is; `path` itself where that is neither.
Path RunFolderOf(const Path& path);

// Whether a checkpoint's settings are those of a fit.
bool IsOfFit(const std::string& settings);

// The files of a run that are there now; other files in its folder are not ours.
std::vector<Path> RunFiles(const Path& folder);
// An error names the first that cannot be removed.
Status RemoveRun(const Path& folder);

}  // namespace tilegrad::train
