// SPDX-License-Identifier: Apache-2.0
// The border of the renderer: every input is checked here, once, and relied on behind.
#pragma once

#include <span>

#include "render/renderer.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Errors name the scene, the array, the index and what was expected.
Status ValidateOptions(const RenderOptions& options);
Status ValidateScenes(std::span<const SceneView> scenes);
Status ValidateBackward(std::span<const SceneView> scenes, const RenderOptions& options,
                        const Frame& frame, const FrameGradients& d_frame,
                        std::span<const SceneGradients> d_scenes);
// Gradients that overflow float are an error, not an Inf that spreads.
Status ValidateResult(std::span<const SceneGradients> d_scenes);

}  // namespace tilegrad
