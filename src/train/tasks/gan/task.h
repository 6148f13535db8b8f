// SPDX-License-Identifier: Apache-2.0
// `task.kind = "gan"`: section 5.5, textured shapes from noise, learned from pictures alone.
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

std::unique_ptr<Task> MakeGanTask();

}  // namespace tilegrad::train
