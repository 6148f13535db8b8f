// SPDX-License-Identifier: Apache-2.0
// The border of the renderer: what scenes, cotangents and gradients of the public interface must
// hold. T: float, or double of numbers in float's range.
#pragma once

#include <cstdint>
#include <span>

#include "render/frame_images.h"
#include "render/shading/plan.h"
#include "tilegrad/renderer.h"
#include "tilegrad/status.h"

namespace tilegrad {

// What the engine takes for granted and a caller may still get wrong: numbers that are no
// enumerator, from C at least, and lights without a direction, which would be darkness that pulls
// nothing, so that an optimiser would stay there.
template <class T>
Status ValidateEnumerators(std::span<const SceneT<T>> scenes, const RenderOptions& options);

// What the scenes are made of; they agree, and every size, index and number of theirs is sound, but
// those of cameras. Errors name the scene, the array, the index and what was expected.
template <class T>
Result<SceneParts> ValidateScenes(std::span<const SceneT<T>> scenes);

// Sizes of images against `options`, and of gradients against the scenes.
template <class T>
Status ValidateBackward(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                        const FrameGradientsT<T>& d_frame,
                        std::span<const SceneGradientsT<T>> d_scenes);

// Cotangents that are not finite, but of alpha; of depth those of pixels that have a face. Only
// after something was found to be wrong.
template <class T>
Status ValidateCotangents(const FrameGradientsT<T>& d_frame,
                          std::span<const std::int32_t> face_ids);

// Images that overflow float are an error, not an Inf that spreads. Only where one may
// (SceneParts::may_overflow).
Status ValidateImages(const FrameImages& frame);

// Gradients that overflow float are an error, not an Inf that spreads.
Status ValidateResult(std::span<const SceneGradients> d_scenes);

}  // namespace tilegrad
