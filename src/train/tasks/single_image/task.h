// SPDX-License-Identifier: Apache-2.0
// Section 5.1 as a task: shape and vertex colours from a single image.
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

std::unique_ptr<Task> MakeSingleImageTask();

}  // namespace tilegrad::train
