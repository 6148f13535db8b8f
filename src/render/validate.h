// SPDX-License-Identifier: Apache-2.0
// The border of the renderer: what a caller may get wrong is checked here, once in each call and
// before anything is computed; code behind relies on it. What takes long is not checked here but
// where it is read first, in parallel (cotangents of images, sums of gradients): only if that finds
// something, it is searched here. T: float, or double of numbers in float's range.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

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

// Checks of one array or number, for the borders of the renderer (render/validate.h) and of
// src/compat. Errors name the array, the index and what was expected.

// What errors call the n-th scene of a batch.
std::string SceneName(std::size_t n);

// Whether both are the same memory: what was checked once need not be checked again.
template <class T>
bool SameArray(std::span<T> a, std::span<T> b) {
  return a.data() == b.data() && a.size() == b.size();
}

// OK if all values are finite, else an error that names the first one that is not.
Status CheckFinite(const char* array, std::span<const float> values);
Status CheckFinite(const char* array, std::span<const double> values);

// A number as float sees it: beyond its range it is infinite. Scenes in double are held to it, too.
inline float InFloat(float x) { return x; }
float InFloat(double x);
// CheckFinite of such numbers.
Status CheckNumbers(const char* array, std::span<const float> values);
Status CheckNumbers(const char* array, std::span<const double> values);

// An error that says the shape, [rows,width], unless there are that many numbers.
Status CheckShape(const char* array, std::size_t got, std::size_t rows, std::size_t width);

// Unless there are that many numbers.
Status CheckSize(const char* array, std::size_t got, std::size_t expected);

// Unless `value` is finite and >= 0.
Status CheckNotNegative(const char* name, double value);

// Of options.width or options.height.
Status CheckImageSize(const char* axis, int pixels);

}  // namespace tilegrad
