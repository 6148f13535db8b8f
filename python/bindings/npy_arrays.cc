// SPDX-License-Identifier: Apache-2.0
#include "bindings/npy_arrays.h"

#include <pybind11/stl.h>

#include "bindings/to_python.h"

namespace tilegrad::python {
namespace {

constexpr io::NpyType kTypes[] = {io::NpyType::kBool, io::NpyType::kU8,  io::NpyType::kI8,
                                  io::NpyType::kU16,  io::NpyType::kI16, io::NpyType::kU32,
                                  io::NpyType::kI32,  io::NpyType::kU64, io::NpyType::kI64,
                                  io::NpyType::kF32,  io::NpyType::kF64};

py::dtype DTypeOf(io::NpyType type) { return py::dtype(std::string(io::NpyTypeName(type))); }

}  // namespace

py::array NpyToPython(io::NpyArray array) {
  const std::vector<py::ssize_t> shape(array.shape.begin(), array.shape.end());
  const auto bytes = static_cast<py::ssize_t>(array.data.size());
  py::array flat = OwnedArray<std::uint8_t>(std::move(array.data), {bytes});
  return flat.attr("view")(DTypeOf(array.type)).attr("reshape")(shape);
}

io::NpyArray NpyFromPython(const char* function, const std::string& argument,
                           const py::object& object) {
  const auto array = py::cast<py::array>(object);
  for (const io::NpyType type : kTypes) {
    if (!array.dtype().equal(DTypeOf(type)) || !(array.flags() & py::array::c_style)) continue;
    io::NpyArray out{type, {}, {}};
    out.shape.assign(array.shape(), array.shape() + array.ndim());
    const auto* data = static_cast<const std::uint8_t*>(array.data());
    out.data.assign(data, data + array.nbytes());
    return out;
  }
  throw py::type_error(fmt::format(
      "{}: {} has dtype {}, expected a C-contiguous array of bool, integers, float32 or float64",
      function, argument, py::cast<std::string>(py::str(array.dtype()))));
}

}  // namespace tilegrad::python
