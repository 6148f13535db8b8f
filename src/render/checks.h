// SPDX-License-Identifier: Apache-2.0
// Checks of one array or number, for the borders of the renderer (render/validate.h) and of
// src/compat. Errors name the array, the index and what was expected.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad {

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
