// SPDX-License-Identifier: Apache-2.0
// What stands in a run's folder, by name: the run and commands that look at it write these without
// asking, and a run that starts anew takes them away first.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
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

// <run>/run.json: what a run is, for people and for the commands that look at it.

// In words, for names of the log that do not explain themselves.
using TermLabels = std::map<std::string, std::string>;

struct RunHeader {
  std::string name = {};            // the configuration's
  std::string dataset = {};         // folder, as training was given it
  std::string dataset_source = {};  // where its models are from
  int training_models = 0;
  std::int64_t parameters = 0;                                    // numbers that are trained
  std::vector<std::pair<std::string, std::string>> machine = {};  // as DescribeMachine
  TermLabels labels = {};  // of what its steps have said so far
};

Status WriteHeader(const Path& run, const RunHeader& header);
// Errors name the file and the key or line.
Result<RunHeader> ReadHeader(const Path& run);

// What a result depends on besides configuration and data, as name and value: version, compiler,
// CPU, cores, SIMD target.
std::vector<std::pair<std::string, std::string>> DescribeMachine();

}  // namespace tilegrad::train
