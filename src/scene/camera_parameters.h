// SPDX-License-Identifier: Apache-2.0
// A camera as what an optimiser may move: six numbers of rotation (camera_ref.h), translation,
// focal lengths and principal point.
//
//   CameraParameters p = ParametersOf(start);
//   Camera camera = CameraFromParameters(p, near).value();      // render with it
//   PullBack(p, d_scene.d_camera, &d_p);                        // gradient of what Backward gave
#pragma once

#include "scene/camera_ref.h"
#include "tilegrad/status.h"

namespace tilegrad {

using CameraParameters = CameraParametersT<float>;

// The first two rows of the rotation and the rest as they are.
CameraParameters ParametersOf(const Camera& camera);

// Errors: a number that is not finite; a and b so short (1e-6 of a unit) or so nearly parallel
// (1e-6 rad) that they give no rotation; a focal length or near plane that is not positive.
Result<Camera> CameraFromParameters(const CameraParameters& parameters, float near_plane);

// dL/d(parameters) from dL/d(camera), in double inside. `parameters` as CameraFromParameters
// accepts them. near_plane has no gradient.
void PullBack(const CameraParameters& parameters, const Camera& d_camera,
              CameraParameters* d_parameters);

}  // namespace tilegrad
