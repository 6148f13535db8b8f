// SPDX-License-Identifier: Apache-2.0
// The configuration of a training run, read from and written to TOML:
//
//   name = "quick"
//   [task]
//   kind = "single_image"       if it is not there: this one
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
  std::string name = "paper";  // for people
  std::string kind;            // of `task`
  Schedule schedule;
  std::unique_ptr<Task> task;

  ConfigFields Fields();  // of all its parts
};

// An unknown key, a wrong type or a value out of range is an error that names file, line and key,
// and the known keys that are near.
Result<TrainConfig> ReadConfig(const Path& path);
Result<TrainConfig> ParseConfig(std::string_view text,
                                const std::string& name);  // `name` stands in messages
// "schedule.steps=100" and the like, applied in order. The kind of task stays.
Status ApplyOverrides(const std::vector<std::string>& assignments, TrainConfig* config);
// Complete, with a comment on each key; reading it back gives the same configuration.
std::string WriteConfig(const TrainConfig& config);

// Of configs/, compiled in: a program that was installed, or moved, knows them.
struct NamedConfig {
  std::string_view name, text;  // "quick", and the file that has it
};
// Sorted by name.
std::span<const NamedConfig> NamedConfigs();
// NotFound lists the names.
Result<NamedConfig> ConfigNamed(std::string_view name);

// The file of that path; if there is none, the configuration of that name. So "quick" is found
// wherever the program runs, and a file "quick" in the current folder goes before it. Errors as of
// ReadConfig; NotFound lists the names.
Result<TrainConfig> FindConfig(const std::string& path_or_name);

}  // namespace tilegrad::train
