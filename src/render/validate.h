// SPDX-License-Identifier: Apache-2.0
// Input validation of the renderer: checks every possible error of the caller once per call, before
// any computation; the code behind relies on it. Checks that take long run in parallel where the
// data is first read (cotangents of images, sums of gradients); only if they fail, the functions
// here search for the culprit. T: float, or double with numbers in float's range.
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

// Returns what the scenes consist of. Checks that options are in range, that scenes agree, and that
// all their enumerators, sizes, indices and numbers are valid; checks scenes in parallel. Lights
// must have a direction: a light without one is dark and has no gradient, so an optimiser could not
// leave that state. Errors name the scene, the array, the index and the expected value.
template <class T>
Result<SceneParts> ValidateScenes(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                                  const Workers& workers);

// Checks sizes of cotangents against the frame of valid scenes, and of gradients against the
// scenes.
template <class T>
Status ValidateBackward(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                        const FrameImagesT<T>& frame, const FrameGradientsT<T>& d_frame,
                        std::span<const SceneGradientsT<T>> d_scenes);

// Finds cotangents that are not finite, except of alpha; for depth only at pixels with a face. Call
// only after a check has failed.
template <class T>
Status ValidateCotangents(const FrameGradientsT<T>& d_frame,
                          std::span<const std::int32_t> face_ids);

// An error if images overflow float, rather than an Inf that spreads. Only needed if
// SceneParts::may_overflow.
Status ValidateImages(const FrameImages& frame);

// Checks of one array or number, for input validation in the renderer (render/validate.h) and in
// src/compat. Errors name the array, the index and the expected value.

// The name of the n-th scene of a batch in errors.
std::string SceneName(std::size_t n);

// Whether both are the same memory, so that checking one suffices.
template <class T>
bool SameArray(std::span<T> a, std::span<T> b) {
  return a.data() == b.data() && a.size() == b.size();
}

// OK if all values are finite, else an error that names the first that is not.
Status CheckFinite(const char* array, std::span<const float> values);
Status CheckFinite(const char* array, std::span<const double> values);

// A number rounded to float: infinite beyond its range. Scenes in double must meet it, too.
inline float InFloat(float x) { return x; }
float InFloat(double x);
// CheckFinite for such numbers.
Status CheckNumbers(const char* array, std::span<const float> values);
Status CheckNumbers(const char* array, std::span<const double> values);

// An error with the expected shape, [rows,width], unless `got` is their product.
Status CheckShape(const char* array, std::size_t got, std::size_t rows, std::size_t width);

// An error unless got == expected.
Status CheckSize(const char* array, std::size_t got, std::size_t expected);

// An error unless `value` is finite and >= 0.
Status CheckNotNegative(const char* name, double value);

// For options.width or options.height.
Status CheckImageSize(const char* axis, int pixels);

}  // namespace tilegrad
