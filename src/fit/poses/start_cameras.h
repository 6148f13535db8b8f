// SPDX-License-Identifier: Apache-2.0
// The cameras that a fit starts from, and masks where it has none.
#pragma once

#include "fit/run.h"

namespace tilegrad::train {

struct CameraSearch {
  bool look = false;    // looks for cameras in the images, though the input has some
  bool resume = false;  // reads what an earlier call found and kept in <out>/cameras_start.json
};

// First StartMasks, unless cameras are not to be believed. Then cameras of images that came
// without, or that are not to be believed (FindInputPoses); else, where cameras are to be fitted
// together with a shape, better ones to start from (RefineInputPoses). Changes `job`: input,
// start_cameras, config.cameras_rest. May add warnings to the input; its notes say how sure the
// masks are and where one more picture would help most. Errors: those of the two.
Status StartCameras(const CameraSearch& search, FitJob* job, const Workers& workers,
                    const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
