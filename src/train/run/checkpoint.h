// SPDX-License-Identifier: Apache-2.0
// Checkpoints of a run: <run>/checkpoints/step_00001500.safetensors with every weight, batch-norm
// statistic and Adam moment, and the step. Data order and views follow from (seed, step), so this
// is all that a run's future depends on.
#pragma once

#include <fmt/format.h>

#include <sstream>
#include <string>
#include <vector>

#include "base/file.h"
#include "nn/serialize.h"

namespace tilegrad::train {

struct CheckpointInfo {
  std::int64_t step = 0;        // steps done
  std::int64_t image_size = 0;  // pixels
  std::string config;           // TOML of the run
  double seconds = 0;           // trained so far
  // Of what it predicts, world units; earlier versions wrote none and trained at this size.
  double half_extent = 0.45;
  std::string credits = {};  // of what it was trained on, a line each; files of weights have them
};

struct Checkpoint {
  CheckpointInfo info;
  std::vector<nn::NamedTensor> tensors;
};

// Whole or not at all.
Status SaveCheckpoint(const Path& run, const CheckpointInfo& info,
                      std::vector<nn::NamedTensor> tensors);
// One file of what predicts, a checkpoint that cannot be resumed: `weights` has the tensors that
// Task::LoadModel reads. kHalf: as of EncodeSafetensors.
Status WriteWeights(nn::Context& context, const Path& file, const Checkpoint& weights,
                    nn::StoredFloats floats);
// Errors name the file: cut short, not a checkpoint of this program, another checksum, ...
Result<Checkpoint> LoadCheckpoint(nn::Context& context, const Path& file);

struct FoundCheckpoint {
  Checkpoint checkpoint;
  Path file;
  std::vector<std::string> warnings;  // newer files that are damaged
  std::vector<Path> broken;           // these files
};

// The newest whole one. Skips only damaged files (cut short, wrong checksum): any other reason
// (another version's format, permissions, memory) is an error, because resuming from an older file
// would lose steps. NotFound if there is none; DataLoss names the first reason if all are damaged.
Result<FoundCheckpoint> LoadNewestCheckpoint(nn::Context& context, const Path& run);

// The newest one of a run's folder, or the one file that `path` is or names (FindRun).
Result<FoundCheckpoint> FindCheckpoint(nn::Context& context, const Path& path);

// Renames files to "step_00000012.safetensors.broken": they must not count among those to keep.
void SetAside(const std::vector<Path>& broken);

// All checkpoint files of a run, oldest first: step_NUMBER.safetensors, nothing else.
std::vector<Path> ListCheckpoints(const Path& run);
// Removes all but the newest `keep`.
void PruneCheckpoints(const Path& run, std::int64_t keep);
// Removes half-written files that a killed run left in its folder.
void RemoveHalfWritten(const Path& run);

// The first line in which two texts differ: was "rate = 1", is "rate = 2" (none: no such line); ""
// if they are equal.
inline std::string FirstDifference(const std::string& was, const std::string& is) {
  std::istringstream old_lines(was), new_lines(is);
  for (std::string a, b;;) {
    const bool more_a = static_cast<bool>(std::getline(old_lines, a));
    const bool more_b = static_cast<bool>(std::getline(new_lines, b));
    if (!more_a && !more_b) return "";
    if (more_a && more_b && a == b) continue;
    const auto quoted = [](bool there, const std::string& line) {
      return there ? fmt::format("\"{}\"", line) : std::string("none");
    };
    return fmt::format("was {}, is {}", quoted(more_a, a), quoted(more_b, b));
  }
}

}  // namespace tilegrad::train
