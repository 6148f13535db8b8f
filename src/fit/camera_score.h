// SPDX-License-Identifier: Apache-2.0
// How far cameras were off, and are.
#pragma once

#include <span>
#include <vector>

#include "fit/run.h"

namespace tilegrad::train {

std::vector<Camera> Choose(std::span<const Camera> cameras, std::span<const int> views);

// Cameras as the input gave them; those that were found live in a world of their own.
const std::vector<Camera>& GivenCameras(const FitInput& input);

// camera_error_before and _after of the training views, where cameras were turned or found although
// they were given; both after alignment, where that is free.
void ScoreCameras(const FitJob& job, const FitScene& scene, FitOutcome* outcome);

}  // namespace tilegrad::train
