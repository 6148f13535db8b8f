// SPDX-License-Identifier: Apache-2.0
// Which tasks there are, by the name that `task.kind` has in a configuration.
#pragma once

#include <memory>
#include <string>

#include "train/tasks/task.h"

namespace tilegrad::train {

inline constexpr const char* kDefaultTask = "single_image";  // of configurations that name none

using TaskFactory = std::unique_ptr<Task> (*)();

// For additional tasks of a program, before any training; tilegrad's own are registered already.
void RegisterTask(const std::string& kind, TaskFactory make);

// With the defaults of its fields. InvalidArgument lists the kinds there are.
Result<std::unique_ptr<Task>> MakeTask(const std::string& kind);

}  // namespace tilegrad::train
