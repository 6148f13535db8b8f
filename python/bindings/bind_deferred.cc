// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.nvdiffrast needs of the engine.
#include "bindings/arrays.h"

namespace tilegrad::python {

void BindDeferred(py::module_& m);

void BindDeferred(py::module_&) {}

}  // namespace tilegrad::python
