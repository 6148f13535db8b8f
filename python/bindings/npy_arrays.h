// SPDX-License-Identifier: Apache-2.0
// Arrays of the dtypes that files hold.
#pragma once

#include "bindings/arrays.h"
#include "io/npz.h"

namespace tilegrad::python {

py::array NpyToPython(io::NpyArray array);

// A copy of a C-contiguous array. TypeError for a dtype that .npy files of ours do not hold, which
// names `function` and `argument`.
io::NpyArray NpyFromPython(const char* function, const std::string& argument,
                           const py::object& array);

}  // namespace tilegrad::python
