// SPDX-License-Identifier: Apache-2.0
// A part of a scene for every image of a batch: one array that all share, or one of a leading axis
// more, which holds each image's own.
#pragma once

#include <vector>

#include "bindings/arrays.h"

namespace tilegrad::python {

// T: const for what is read.
template <class T>
class Field {
 public:
  Field() = default;

  // `array`: None, or a C-contiguous array of `shape` or [count, shape...]. TypeError or ValueError
  // otherwise. Valid while the array lives.
  Field(const char* function, const char* argument, const py::object& array,
        const std::vector<py::ssize_t>& shape, std::size_t count) {
    if (array.is_none()) return;
    const auto values = py::reinterpret_borrow<py::array>(array);
    own_ = py::isinstance<py::array>(array) &&
           static_cast<std::size_t>(values.ndim()) == shape.size() + 1;
    std::vector<py::ssize_t> expected = shape;
    if (own_) expected.insert(expected.begin(), static_cast<py::ssize_t>(count));
    all_ = TakeSpan(function, argument, array, expected);
    size_ = own_ && count > 0 ? all_.size() / count : all_.size();
    given_ = true;
  }

  bool given() const { return given_; }
  bool own() const { return own_; }  // each image's own
  std::size_t arrays() const { return own_ && size_ > 0 ? all_.size() / size_ : 1; }
  std::span<T> all() const { return all_; }
  std::span<T> Of(std::size_t image) const { return all_.subspan(own_ ? image * size_ : 0, size_); }

 private:
  static std::span<T> TakeSpan(const char* function, const char* argument, const py::object& array,
                               const std::vector<py::ssize_t>& shape) {
    if constexpr (std::is_const_v<T>) {
      return SpanOf<std::remove_const_t<T>>(array, function, argument, shape);
    } else {
      return MutableSpanOf<T>(array, function, argument, shape);
    }
  }

  std::span<T> all_;
  std::size_t size_ = 0;  // of one image
  bool given_ = false, own_ = false;
};

}  // namespace tilegrad::python
