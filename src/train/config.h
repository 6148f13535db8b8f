// SPDX-License-Identifier: Apache-2.0
// The configuration of a training run, read from and written to TOML:
//
//   name = "quick"
//   [task]
//   kind = "single_image"       the default
//   ...                         the task's own keys: Task::Fields
//   [schedule]
//   steps = 3000                see run/run.h
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

struct TrainConfig {
  std::string name = "paper";  // a label for people
  std::string kind;            // of `task`
  Schedule schedule;
  std::unique_ptr<Task> task;

  ConfigFields Fields();  // of all parts
};

// An unknown key, a wrong type or a value out of range is an error that names file, line and key,
// and similar known keys.
Result<TrainConfig> ReadConfig(const Path& path);
Result<TrainConfig> ParseConfig(std::string_view text,
                                const std::string& name);  // `name` appears in messages
// Applies assignments such as "schedule.steps=100" in order; task.kind cannot be changed.
Status ApplyOverrides(const std::vector<std::string>& assignments, TrainConfig* config);
// Complete, with a comment on each key; reading it back gives the same configuration.
std::string WriteConfig(const TrainConfig& config);

// A file of configs/, compiled in so that an installed or moved program has it.
struct NamedConfig {
  std::string_view name, text;  // "quick", and the text of its file
};
// Sorted by name.
std::span<const NamedConfig> NamedConfigs();
// NotFound lists the names.
Result<NamedConfig> ConfigNamed(std::string_view name);

// The file at that path or, if there is none, the configuration of that name: "quick" works in any
// folder, but a file "quick" in the current one takes precedence. Errors: as ReadConfig; NotFound
// lists the names.
Result<TrainConfig> FindConfig(const std::string& path_or_name);

}  // namespace tilegrad::train
