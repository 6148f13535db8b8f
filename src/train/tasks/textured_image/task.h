// SPDX-License-Identifier: Apache-2.0
// Sections 5.2 and 5.3 of the paper: shape, texture and light from one image.
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

// `task.kind = "textured_image"`.
std::unique_ptr<Task> MakeTexturedImageTask();

}  // namespace tilegrad::train
