// SPDX-License-Identifier: Apache-2.0
// The cameras that a fit starts from, and masks where it has none.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <string>

#include "fit/input.h"
#include "fit/poses/find_poses.h"
#include "fit/run.h"
#include "scene/camera.h"

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

// Where one more picture would help most: the direction from the object that is farthest from all
// cameras, relative to the nearest camera.
struct ViewGap {
  std::size_t nearest = 0;  // index of that camera
  double degrees = 0;       // angle between the two at the object
  // From the camera to the direction: around the object to the photographer's right, and upwards.
  double right = 0, up = 0;  // degrees
};

// The direction from the object's `middle` with the largest gap, of those every 5 degrees around
// and from level to 60 degrees above. Needs at least one camera. Up is the cameras' mean up,
// because people hold them level on the whole.
ViewGap WidestGap(std::span<const Camera> cameras, glm::vec3 middle);

// "about 40 degrees to the right of NAME and 20 higher"
std::string DescribePlace(const ViewGap& gap, const std::string& name);

// An input's cameras, found and kept beside the run.
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
