// SPDX-License-Identifier: Apache-2.0
// The known tasks, by their `task.kind` in configurations.
#pragma once

#include <memory>
#include <string>

#include "train/tasks/task.h"

namespace tilegrad::train {

inline constexpr const char* kDefaultTask = "single_image";  // of configurations that name none

using TaskFactory = std::unique_ptr<Task> (*)();

// Registers a task of an embedding program, before any training; tilegrad's own are registered
// already.
void RegisterTask(const std::string& kind, TaskFactory make);

// With the defaults of its fields. InvalidArgument lists the known kinds.
Result<std::unique_ptr<Task>> MakeTask(const std::string& kind);

// tilegrad's own, by their kinds. "single_image": section 5.1 of the paper, shape and vertex
// colours from one image.
std::unique_ptr<Task> MakeSingleImageTask();
// "textured_image": sections 5.2 and 5.3, shape, texture and light from one image.
std::unique_ptr<Task> MakeTexturedImageTask();
// "photographs": section 5.4, shape, texture, keypoints and camera from photographs, one view of
// each object, in a folder as train/data/photographs/photographs.h has it.
std::unique_ptr<Task> MakePhotographsTask();
// "gan": section 5.5, textured shapes from noise, learned from pictures alone.
std::unique_ptr<Task> MakeGanTask();
// "classify": the class of an object from one picture of it, for a perceptual loss
// (classify/perceptual_network.h).
std::unique_ptr<Task> MakeClassifyTask();

}  // namespace tilegrad::train
