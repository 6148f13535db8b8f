// SPDX-License-Identifier: Apache-2.0
// The renderer of include/tilegrad.
#include "bindings/arrays.h"
#include "tilegrad/renderer.h"

namespace tilegrad::python {

void BindRenderer(py::module_& m);

void BindRenderer(py::module_& m) {
  const v0::RenderOptions defaults;
  m.attr("DEFAULTS") = py::dict(
      py::arg("width") = defaults.width, py::arg("height") = defaults.height,
      py::arg("delta") = defaults.delta, py::arg("max_alpha_error") = defaults.max_alpha_error,
      py::arg("paper_box") = defaults.paper_box, py::arg("paper_faces") = defaults.paper_faces);
}

}  // namespace tilegrad::python
