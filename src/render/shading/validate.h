// SPDX-License-Identifier: Apache-2.0
// The border of the shaded renderer, beside validate.h: what shading adds to scenes.
#pragma once

#include <cstdint>
#include <span>

#include "render/scene.h"
#include "render/shading/plan.h"
#include "tilegrad/status.h"

namespace tilegrad {

// What the scenes are made of; they agree, and every size, index and number of theirs is sound.
// Errors name the scene, the array, the index and what was expected.
Result<SceneParts> ValidateShadedScenes(std::span<const ShadedScene> scenes);

// Sizes of images against `frame`, and of gradients against the scenes.
Status ValidateShadedBackward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                              const ShadedFrameGradients& d_frame,
                              std::span<const ShadedGradients> d_scenes);

// Cotangents that are not finite, of depth those of pixels that have a face; only after something
// was found to be wrong.
Status ValidateShadedCotangents(const ShadedFrameGradients& d_frame,
                                std::span<const std::int32_t> face_ids);

// Gradients that overflow float are an error, not an Inf that spreads.
Status ValidateShadedResult(std::span<const ShadedGradients> d_scenes);

}  // namespace tilegrad
