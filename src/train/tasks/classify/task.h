// SPDX-License-Identifier: Apache-2.0
// `task.kind = "classify"`: the class of an object from one picture of it. Its
// purpose is a network for a perceptual loss (perceptual_network.h).
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

std::unique_ptr<Task> MakeClassifyTask();

}  // namespace tilegrad::train
