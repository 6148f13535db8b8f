// SPDX-License-Identifier: Apache-2.0
// The files of a run's folder, by name: written without asking, and removed by a run that starts
// anew.
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
// What a run was trained on, a line each.
inline constexpr const char* kTrainedModels = "training_models.txt";
inline constexpr const char* kTrainedPhotographs = "training_photographs.txt";

// Files BEGINNING00001500ENDING of a folder by their step; ignores others. An error if the folder
// exists and cannot be read.
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

// Name and value of version, compiler, CPU, cores and SIMD target, on which results depend.
std::vector<std::pair<std::string, std::string>> DescribeMachine();

}  // namespace tilegrad::train
