// SPDX-License-Identifier: Apache-2.0
// Cameras of pictures that came without: from masks and colours alone.
#pragma once

#include <span>
#include <vector>

#include "base/progress.h"
#include "fit/image_loss.h"
#include "scene/camera.h"

namespace tilegrad::train {

struct PoseOptions {
  int starts = 4;
  std::vector<Camera> truth;  // debugging
};

struct FoundPoses {
  std::vector<Camera> cameras;  // of the images, in their pixels
  double loss = 0;
};

// `lenses`: intrinsics of each image; their poses are not looked at.
Result<FoundPoses> FindPoses(const TargetImages& images, std::span<const Camera> lenses,
                             const PoseOptions& options, const Workers& workers,
                             const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
