// SPDX-License-Identifier: Apache-2.0
// Engine functions for two kinds of numbers as functions of Python: all arrays of a call are
// float32, or all are float64.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "bindings/arrays.h"
#include "bindings/kept_memory.h"

namespace tilegrad::python {

// call(float()) or call(double()), by the numbers of `array`, which is the argument of that name.
template <class Call>
auto Dispatch(const py::array& array, const char* function, const char* argument,
              const Call& call) {
  if (py::isinstance<py::array_t<float>>(array)) return call(float());
  if (py::isinstance<py::array_t<double>>(array)) return call(double());
  throw py::type_error(fmt::format("{}: {} has dtype {}, expected float32 or float64", function,
                                   argument, py::str(array.dtype()).cast<std::string>()));
}

// A result, uninitialised.
template <class T>
py::array_t<T> NewArray(const std::vector<py::ssize_t>& shape) {
  std::size_t bytes = sizeof(T);
  for (const py::ssize_t n : shape) bytes *= static_cast<std::size_t>(n);
  if (bytes < kLeastKeptBytes) return py::array_t<T>(shape);
  const KeptBlock block = TakeKeptBlock(bytes);
  return py::array_t<T>(shape, static_cast<T*>(block.data), block.owner);
}

// One of the shape of another array.
template <class T>
py::array_t<T> NewArrayLike(const py::array& array) {
  return NewArray<T>({array.shape(), array.shape() + array.ndim()});
}

template <class T>
std::span<T> NumbersOf(py::array_t<T>& array) {
  return {array.mutable_data(), static_cast<std::size_t>(array.size())};
}

// The same of an array that may be absent: empty then.
template <class T>
std::span<T> NumbersOf(std::optional<py::array_t<T>>& array) {
  return array.has_value() ? NumbersOf(*array) : std::span<T>();
}
template <class T>
std::span<const T> OptionalSpanOf(const std::optional<py::array>& array, const char* function,
                                  const char* argument, const std::vector<py::ssize_t>& shape) {
  return array.has_value() ? SpanOf<T>(*array, function, argument, shape) : std::span<const T>();
}

// Engine work, other Python threads running.
template <class Work>
void Run(const char* function, const Work& work) {
  Status status;
  {
    const py::gil_scoped_release released;
    status = work();
  }
  ThrowIfError(status.Within(function));
}

}  // namespace tilegrad::python
