// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.kaolin needs of the engine.
#include "bindings/arrays.h"

namespace tilegrad::python {

void BindKaolin(py::module_& m);

void BindKaolin(py::module_&) {}

}  // namespace tilegrad::python
