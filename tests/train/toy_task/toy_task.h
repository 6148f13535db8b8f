// SPDX-License-Identifier: Apache-2.0
// The smallest task: three numbers, the size of a box, from the colour of an image. It stands here
// and not in src/ to show that a task needs nothing but train/tasks/task.h. Its two optimisers take
// turns within a step, as those of an adversarial task do.
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

std::unique_ptr<Task> MakeToyTask();

}  // namespace tilegrad::train
