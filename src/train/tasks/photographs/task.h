// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "train/tasks/task.h"

namespace tilegrad::train {

// `task.kind = "photographs"`: shape, texture, keypoints and camera from photographs, one view of
// each object (section 5.4). Its dataset is a folder as train/data/photographs/photographs.h has
// it.
std::unique_ptr<Task> MakePhotographsTask();

}  // namespace tilegrad::train
