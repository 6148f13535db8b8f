// SPDX-License-Identifier: Apache-2.0
// What bindings of single kernels have in common: arrays in, new arrays out.
#pragma once

#include <initializer_list>
#include <span>
#include <vector>

#include "bindings/arrays.h"

namespace tilegrad::python {

// call(float()) or call(double()), by the numbers of `array`; TypeError if they are others.
template <class Call>
auto ByNumbers(const py::array& array, const char* function, const char* argument,
               const Call& call) {
  if (py::isinstance<py::array_t<float>>(array)) return call(float());
  if (py::isinstance<py::array_t<double>>(array)) return call(double());
  throw py::type_error(fmt::format("{}: {} has dtype {}, expected float32 or float64", function,
                                   argument, py::str(array.dtype()).cast<std::string>()));
}

template <class T>
py::array_t<T> NewArray(std::initializer_list<py::ssize_t> shape) {
  return py::array_t<T>(std::vector<py::ssize_t>(shape));
}

template <class T>
std::span<T> NumbersOf(py::array_t<T>& array) {
  return {array.mutable_data(), static_cast<std::size_t>(array.size())};
}

// Work of the engine, while other Python threads run. Throws if its Status is an error.
template <class Work>
void RunWithoutGil(const char* function, const Work& work) {
  Status status;
  {
    const py::gil_scoped_release released;
    status = work();
  }
  ThrowIfError(status.Within(function));
}

}  // namespace tilegrad::python
