// SPDX-License-Identifier: Apache-2.0
// A camera as free parameters for an optimiser: six numbers of rotation (camera_ref.h),
// translation, focal lengths and principal point.
//
//   CameraParameters p = ParametersOf(start);
//   Camera camera = CameraFromParameters(p, near).value();      // render with it
//   PullBack(p, d_scene.d_camera, &d_p);                        // gradient of what Backward gave
#pragma once

#include <type_traits>

#include "scene/camera_ref.h"
#include "tilegrad/status.h"

namespace tilegrad {

using CameraParameters = CameraParametersT<float>;

// T below: float or double; inside all is double.

// The first two rows of the rotation and the rest as they are.
template <class T = float>
CameraParametersT<T> ParametersOf(const CameraT<T>& camera);

// Errors: a number that is not finite; a and b so short (1e-6 of a unit) or so nearly parallel
// (1e-6 rad) that they give no rotation; a focal length or near plane that is not positive.
template <class T = float>
Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>& parameters,
                                        std::type_identity_t<T> near_plane);

// dL/d(parameters) from dL/d(camera). `parameters` as CameraFromParameters accepts them. near_plane
// has no gradient.
template <class T = float>
void PullBack(const CameraParametersT<T>& parameters,
              const std::type_identity_t<CameraT<T>>& d_camera,
              std::type_identity_t<CameraParametersT<T>>* d_parameters);

}  // namespace tilegrad
