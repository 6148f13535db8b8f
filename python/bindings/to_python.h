// SPDX-License-Identifier: Apache-2.0
// Hands results of C++ to Python.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/read_budget.h"
#include "base/text.h"
#include "bindings/arrays.h"
#include "bindings/gil.h"

namespace tilegrad::python {

// The numbers of `values`, a vector of T or of records that hold only T, as an array of `shape`.
template <class T, class Vector>
py::array OwnedArray(Vector values, std::vector<py::ssize_t> shape) {
  CheckCount(values.size() * sizeof(values[0]) / sizeof(T), shape);
  auto owner = std::make_unique<Vector>(std::move(values));
  const void* data = owner->data();
  const py::capsule base(owner.get(), [](void* p) { delete static_cast<Vector*>(p); });
  owner.release();  // the capsule's from here on
  return py::array(py::dtype::of<T>(), std::move(shape), data, base);
}

// The result of `load`, run without the GIL. max_bytes: of ReadBudget; 0: the usual limit.
template <class Load>
auto LoadWithin(std::size_t max_bytes, const Load& load) {
  return ValueOrThrow(WithoutGil([&] {
    std::optional<ReadBudget> budget;
    if (max_bytes > 0) budget.emplace(max_bytes);
    return load();
  }));
}

// Issues a Python warning; escapes bytes that are no text.
inline void WarnUser(const std::string& text) {
  if (PyErr_WarnEx(PyExc_UserWarning, EscapeControls(text).c_str(), 1) != 0)
    throw py::error_already_set();
}

}  // namespace tilegrad::python
