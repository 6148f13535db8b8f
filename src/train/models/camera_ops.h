// SPDX-License-Identifier: Apache-2.0
// Differentiable operations on cameras, and on lights given in their axes.
//
// A camera of weak perspective (scene/weak_perspective.h) is a row of seven numbers: scale, x, y
// and a quaternion (w, x, y, z) of any length > 0, in image units of [-1, 1], x right, y down.
#pragma once

#include <span>

#include "nn/tape.h"
#include "scene/weak_perspective.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {

inline constexpr std::int64_t kWeakNumbers = 7;

// points [B, K, 3], cameras [B, 7] -> [B, K, 2]: their image positions. Gradients to both.
nn::Var ProjectPoints(const nn::Var& points, const nn::Var& cameras);

// rows [B, 6] -> [B, 4]: unit quaternions, w >= 0, of the rotations whose first two rows
// Gram-Schmidt makes from the six numbers. These represent rotations continuously, which four
// numbers cannot (Zhou et al., CVPR 2019, section 4.2). Zero or parallel rows give some rotation
// and a finite gradient.
nn::Var QuaternionsOfRows(const nn::Var& rows);

// cameras [B, 7] -> [B, 16], SceneVars::cameras of images of `size` pixels a side: pinholes at
// kPinholeDistance. With a gradient.
nn::Var PinholeCameras(const nn::Var& cameras, int size);

// World units; objects are about 2 large, so depth changes their image by at most a thousandth. 32
// bits still resolve depths of 1e-4.
inline constexpr double kPinholeDistance = 1000;

// The same for one camera, in pixels of such an image.
Camera PinholeIn(const WeakPerspective& camera, int size);

// [B, 7] without gradient.
nn::Tensor CameraRows(nn::Context& context, std::span<const WeakPerspective> cameras);

// Light from camera axes, which networks use, to world axes, which the renderer uses.
// [N,3] -> [N,3]: R^T d with the rotation R of each image's camera.
nn::Var DirectionsToWorld(const nn::Var& directions, std::span<const Camera> cameras);
// [N,9] -> [N,9], as scene/light_frame.h.
nn::Var HarmonicsToWorld(const nn::Var& sh, std::span<const Camera> cameras);

}  // namespace tilegrad::train
