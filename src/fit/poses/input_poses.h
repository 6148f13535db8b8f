// SPDX-License-Identifier: Apache-2.0
// An input's cameras, found and kept beside the run.
#pragma once

#include "fit/input.h"
#include "fit/poses/find_poses.h"

namespace tilegrad::train {

struct InputPosesJob {
  PoseOptions options;
  Path file;  // cameras_start.json: keeps what was found, so that a fit that goes on need not look
              // again, and one that was stopped does not begin anew; empty: nothing is kept
  bool reuse = false;  // reads `file` if it is there
};

// The cameras of an input without, or of one whose cameras are not to be believed: all views of the
// former, the training views of the latter, whose held-out cameras follow by alignment. Adds a
// warning where they are in doubt. Errors: those of FindPoses; no masks; `file` cannot be written,
// or belongs to other images.
Status FindInputPoses(const InputPosesJob& job, FitInput* input, const Workers& workers,
                      const ProgressSink& progress, const StopFlag& stop);

// `cameras`, those of the training views brought nearer to what the images show, in the world that
// they had. Keeps and reads `job.file` in the same way; `job.options` are not looked at. Errors
// also: those of GuessSphere.
Result<std::vector<Camera>> RefineInputPoses(const InputPosesJob& job, const FitInput& input,
                                             std::span<const Camera> cameras,
                                             const Workers& workers, const Watch& watch = {});

}  // namespace tilegrad::train
