// SPDX-License-Identifier: Apache-2.0
// The border of the renderer: every input is checked here, once, and relied on behind. Sizes and
// options are checked first. The numbers in arrays are checked where they are read first, in
// parallel (quick_checks.h); only if that finds something, they are searched here.
#pragma once

#include <cstddef>
#include <span>

#include "render/pipeline/pipeline.h"
#include "tilegrad/status.h"

namespace tilegrad {

// OK if all values are finite, else an error that names the first one that is not.
Status CheckFinite(const char* array, std::span<const float> values);
Status CheckFinite(const char* array, std::span<const double> values);

// An error that says the shape, [rows,width], unless there are that many numbers.
Status CheckShape(const char* array, std::size_t got, std::size_t rows, std::size_t width);

// Unless there are that many numbers.
Status CheckSize(const char* array, std::size_t got, std::size_t expected);

// Unless `value` is finite and >= 0.
Status CheckNotNegative(const char* name, double value);

// Of options.width or options.height.
Status CheckImageSize(const char* axis, int pixels);

// Errors name the scene, the array, the index and what was expected.
Status ValidateOptions(const RenderOptions& options);
Status ValidateSceneSizes(std::span<const SceneView> scenes);
Status ValidateSceneNumbers(std::span<const SceneView> scenes);
// Of one scene, whom the errors do not name.
Status ValidateSceneSizes(const SceneView& scene);
Status ValidateSceneNumbers(const SceneView& scene);
Status ValidateBackwardSizes(std::span<const SceneView> scenes, const RenderOptions& options,
                             const Frame& frame, const FrameGradients& d_frame,
                             std::span<const SceneGradients> d_scenes);
Status ValidateBackwardNumbers(std::span<const SceneView> scenes, const Frame& frame,
                               const FrameGradients& d_frame);
// Gradients that overflow float are an error, not an Inf that spreads.
Status ValidateResult(std::span<const SceneGradients> d_scenes);
Status ValidateResult(const SceneGradients& d_scene);  // of one scene, whom the error does not name

}  // namespace tilegrad
