// SPDX-License-Identifier: Apache-2.0
// Shared by commands that work on a run: which run, and which dataset it was trained on.
#pragma once

#include <optional>
#include <string>

#include "base/output_guard.h"
#include "cli/command.h"
#include "train/predictor.h"
#include "train/run/run.h"

namespace tilegrad::cli {

// Options of commands that look at a finished run.
struct RunOptions {
  std::string run, data;  // empty: see ChooseRun, ChooseDataset
  int workers = 0;
};
// `what`: what --run takes, for the help.
void AddRunOptions(Command* command, RunOptions* options, const char* what = "run folder");
// --threads. CLI11's envname() would also apply the variable to commands that were not chosen, and
// blame the option.
void AddWorkersOption(Command* command, int* workers);
// TILEGRAD_THREADS; 0 if it is not set.
Result<int> ThreadsFromEnvironment();
// --read-limit (base/read_budget.h): the same as its environment variable.
void AddReadLimitOption(Command* command);
// --force, for base/output_guard.h.
void AddForceOption(Command* command, bool* force);

// The meaning of --resume and --force for an existing run.
train::ExistingRun ExistingOf(bool resume, bool force);
// Whether a run may start or resume in the folder: the folder is empty, or `existing` allows its
// run.
Status CheckRunFolder(const Path& folder, train::ExistingRun existing, const OutputGuard& guard);
// Whether the folder holds a training run or a fit.
Status CheckIsRun(const Path& folder);
// What --run takes, for the help, where weights serve as well as a run.
inline constexpr const char* kRunOrWeights =
    "run folder, checkpoint, file of weights or name of installed weights";
// `given`, a path or the name of weights. If that is empty: the run below runs/ with the newest
// checkpoint; if there is none, the weights named `otherwise`; prints a note that says which. An
// error if there is neither.
Result<Path> ChooseRun(const std::string& given, const char* otherwise = nullptr);
// Adds the command that resumes it to a stopped run's message.
Status WithCommand(const Status& status, const std::string& command);
// Prints a note for each newer checkpoint that could not be read.
Result<train::Predictor> LoadPredictor(const Path& run, const Workers& workers);
// Resolves a path that a run was started with: a relative one is relative to where the run was
// started, which is the current folder or one above the run.
std::optional<Path> FindFromRun(const Path& name, const Path& run);
// `given` or, if that is empty, the dataset that the run's run.json names, resolved by FindFromRun.
// `run` may be a checkpoint; a file of weights names no dataset.
Result<Path> ChooseDataset(const std::string& given, const Path& run);

}  // namespace tilegrad::cli
