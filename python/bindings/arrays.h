// SPDX-License-Identifier: Apache-2.0
// NumPy arrays as spans, and errors as Python's exceptions. tilegrad/_arrays.py has converted and
// named the caller's arrays; this checks what a span relies on: dtype, layout and, where no later
// code knows the number of elements, the shape. The only place for both on this side.
#pragma once

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::python {

namespace py = pybind11;

// Text that may hold names from files, with any bytes: replaces what is not UTF-8.
inline py::str Text(const std::string& bytes) {
  const auto size = static_cast<py::ssize_t>(bytes.size());
  PyObject* text = PyUnicode_DecodeUTF8(bytes.data(), size, "replace");
  if (text == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(text);
}

// ValueError, FileNotFoundError, OSError, MemoryError, KeyboardInterrupt or RuntimeError, by the
// code; a RuntimeWarning where the system has refused threads. Only at the border to Python, with
// the GIL held.
inline void ThrowIfError(const Status& status) {
  const char* const notice = TakeThreadNotice();
  if (notice != nullptr && PyErr_WarnEx(PyExc_RuntimeWarning, notice, 1) != 0) {
    throw py::error_already_set();
  }
  const auto raise = [&](PyObject* type) {
    PyErr_SetObject(type, Text(status.message()).ptr());
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

inline std::string ShapeText(std::span<const py::ssize_t> shape) {
  std::string out = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (i > 0) out += ", ";
    out += shape[i] == kAny ? "any" : std::to_string(shape[i]);
  }
  return out + (shape.size() == 1 ? ",)" : ")");
}

inline std::span<const py::ssize_t> ShapeOf(const py::array& array) {
  return {array.shape(), static_cast<std::size_t>(array.ndim())};
}

inline bool HasShape(const py::array& array, std::span<const py::ssize_t> shape) {
  const auto got = ShapeOf(array);
  bool same = got.size() == shape.size();
  for (std::size_t i = 0; same && i < shape.size(); ++i) {
    same = shape[i] == kAny || shape[i] == got[i];
  }
  return same;
}

// `object` as an array that is C-contiguous, of T (TypeError otherwise) and of `shape`
// (ValueError); kAny matches any length of an axis.
template <class T>
py::array CheckedArray(const py::object& object, const char* function, const char* argument,
                       std::span<const py::ssize_t> shape) {
  if (!py::isinstance<py::array_t<T, py::array::c_style>>(object)) {
    const auto text = [](const py::handle& h) { return py::str(h).template cast<std::string>(); };
    const bool is_array = py::isinstance<py::array>(object);
    throw py::type_error(
        fmt::format("{}: {} must be a C-contiguous array of {}, got {}", function, argument,
                    text(py::dtype::of<T>()),
                    text(is_array ? object.attr("dtype") : py::type::of(object).attr("__name__"))));
  }
  auto array = py::reinterpret_borrow<py::array>(object);
  if (HasShape(array, shape)) return array;
  throw py::value_error(fmt::format("{}: {} has shape {}, expected {}", function, argument,
                                    ShapeText(ShapeOf(array)), ShapeText(shape)));
}

// The numbers of `array`, row-major; valid while the array lives. Errors: as CheckedArray.
template <class T>
std::span<const T> SpanOf(const py::object& array, const char* function, const char* argument,
                          const std::vector<py::ssize_t>& shape) {
  const py::array checked = CheckedArray<T>(array, function, argument, shape);
  return {static_cast<const T*>(checked.data()), static_cast<std::size_t>(checked.size())};
}

// The same, to be written to; ValueError if the array is read-only.
template <class T>
std::span<T> MutableSpanOf(const py::object& array, const char* function, const char* argument,
                           const std::vector<py::ssize_t>& shape) {
  py::array checked = CheckedArray<T>(array, function, argument, shape);
  if (!checked.writeable()) {
    throw py::value_error(fmt::format("{}: {} is read-only", function, argument));
  }
  return {static_cast<T*>(checked.mutable_data()), static_cast<std::size_t>(checked.size())};
}

// Catches a bug before anything reads or writes past the end of an array.
inline void CheckCount(std::size_t count, std::span<const py::ssize_t> shape) {
  std::size_t numbers = 1;
  for (const py::ssize_t axis : shape) numbers *= static_cast<std::size_t>(axis);
  if (numbers == count) return;
  throw std::runtime_error(
      fmt::format("internal error: an array of shape {} with {} numbers", ShapeText(shape), count));
}

// `data` of `owner` as an array that keeps the owner alive. Read-only unless `writeable`.
template <class T>
py::array ViewOf(std::span<const T> data, const std::vector<py::ssize_t>& shape,
                 const py::object& owner, bool writeable = false) {
  CheckCount(data.size(), shape);
  py::array_t<T> view(shape, data.data(), owner);
  if (!writeable) {
    py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  }
  return view;
}

// A new array with a copy of `values`.
template <class T>
py::array CopyOf(std::span<const T> values, const std::vector<py::ssize_t>& shape) {
  CheckCount(values.size(), shape);
  return py::array_t<T>(shape, values.data());
}

}  // namespace tilegrad::python
