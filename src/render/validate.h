// SPDX-License-Identifier: Apache-2.0
// The border of the renderer: what a caller may get wrong is checked here, once in each call and
// before anything is computed; code behind relies on it. What takes long is not checked here but
// where it is read first, in parallel (cotangents of images, sums of gradients): only if that finds
// something, it is searched here. T: float, or double of numbers in float's range.
#pragma once

#include <cstdint>
#include <span>

#include "base/parallel.h"
#include "render/frame_images.h"
#include "render/shading/plan.h"
#include "tilegrad/renderer.h"
#include "tilegrad/status.h"

namespace tilegrad {

// What the scenes are made of. Options are in their ranges; scenes agree, and every enumerator,
// size, index and number of theirs is sound: scenes are looked through side by side. Lights have a
// direction: a light without one is dark and has no gradient, so an optimiser could not leave that
// state. Errors name the scene, the array, the index and what was expected.
template <class T>
Result<SceneParts> ValidateScenes(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                                  const Workers& workers);

// Sizes of cotangents against the frame of valid scenes, and of gradients against the scenes.
template <class T>
Status ValidateBackward(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                        const FrameImagesT<T>& frame, const FrameGradientsT<T>& d_frame,
                        std::span<const SceneGradientsT<T>> d_scenes);

// Cotangents that are not finite, but of alpha; of depth those of pixels that have a face. Only
// after something was found to be wrong.
template <class T>
Status ValidateCotangents(const FrameGradientsT<T>& d_frame,
                          std::span<const std::int32_t> face_ids);

// Images that overflow float are an error, not an Inf that spreads. Only where one may
// (SceneParts::may_overflow).
Status ValidateImages(const FrameImages& frame);

}  // namespace tilegrad
