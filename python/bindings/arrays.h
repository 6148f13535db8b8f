// SPDX-License-Identifier: Apache-2.0
// NumPy arrays as spans, and errors as Python's exceptions. tilegrad/_arrays.py has converted and
// named what the caller gave; here the same is checked once more, because a wrong size would read
// memory of others. The one home of both on this side.
#pragma once

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad::python {

namespace py = pybind11;

// ValueError, FileNotFoundError, OSError, MemoryError, KeyboardInterrupt or RuntimeError, by the
// code. Only at the border to Python, with the GIL held.
inline void ThrowIfError(const Status& status) {
  const auto raise = [&](PyObject* type) {
    PyErr_SetString(type, status.message().c_str());
    throw py::error_already_set();
  };
  switch (status.code()) {
    case StatusCode::kOk:
      return;
    case StatusCode::kInvalidArgument:
    case StatusCode::kDataLoss:
      raise(PyExc_ValueError);
      break;
    case StatusCode::kNotFound:
      raise(PyExc_FileNotFoundError);
      break;
    case StatusCode::kIo:
      raise(PyExc_OSError);
      break;
    case StatusCode::kResourceExhausted:
      raise(PyExc_MemoryError);
      break;
    case StatusCode::kCancelled:
      raise(PyExc_KeyboardInterrupt);
      break;
    case StatusCode::kInternal:
      raise(PyExc_RuntimeError);
  }
}

// The value of a Result; its error as above.
template <class T>
T ValueOrThrow(Result<T> result) {
  ThrowIfError(result.status());
  return std::move(result).value();
}

inline constexpr py::ssize_t kAny = -1;  // any length of an axis

inline std::string ShapeText(const py::ssize_t* shape, std::size_t ndim) {
  std::string out = "(";
  for (std::size_t i = 0; i < ndim; ++i) {
    if (i > 0) out += ", ";
    out += shape[i] == kAny ? "any" : std::to_string(shape[i]);
  }
  return out + (ndim == 1 ? ",)" : ")");
}

// Throws unless `array` is C-contiguous, of T (TypeError) and of `shape` (ValueError).
template <class T>
void CheckArray(const py::array& array, const char* function, const char* argument,
                std::initializer_list<py::ssize_t> shape) {
  if (!py::isinstance<py::array_t<T, py::array::c_style>>(array)) {
    throw py::type_error(fmt::format("{}: {} must be a C-contiguous array of {}, got {}", function,
                                     argument,
                                     py::str(py::dtype::of<T>()).template cast<std::string>(),
                                     py::str(array.dtype()).template cast<std::string>()));
  }
  bool same = static_cast<std::size_t>(array.ndim()) == shape.size();
  std::size_t axis = 0;
  for (const py::ssize_t length : shape) {
    same = same && (length == kAny || length == array.shape(static_cast<py::ssize_t>(axis++)));
  }
  if (same) return;
  throw py::value_error(
      fmt::format("{}: {} has shape {}, expected {}", function, argument,
                  ShapeText(array.shape(), static_cast<std::size_t>(array.ndim())),
                  ShapeText(shape.begin(), shape.size())));
}

// The numbers of `array`, row-major; valid while the array lives. kAny stands for any length of an
// axis.
template <class T>
std::span<const T> SpanOf(const py::array& array, const char* function, const char* argument,
                          std::initializer_list<py::ssize_t> shape) {
  CheckArray<T>(array, function, argument, shape);
  return {static_cast<const T*>(array.data()), static_cast<std::size_t>(array.size())};
}

// The same, to be written to; ValueError if the array is read-only.
template <class T>
std::span<T> MutableSpanOf(const py::array& array, const char* function, const char* argument,
                           std::initializer_list<py::ssize_t> shape) {
  CheckArray<T>(array, function, argument, shape);
  if (!array.writeable()) {
    throw py::value_error(fmt::format("{}: {} is read-only", function, argument));
  }
  return {static_cast<T*>(const_cast<void*>(array.data())), static_cast<std::size_t>(array.size())};
}

}  // namespace tilegrad::python
